"""What to drive next: the manoeuvre that would best tell competing explanations apart.

Every manoeuvre of the library that the vehicle can do is simulated under each explanation with its fitted values.
Data that one explanation makes are then given to each other one, which may change its own parameters, whatever
is uncertain anyway, and the initial state of every window. The weighted error that is left is what a log of that
manoeuvre would hold against it: chi-square distributed with this non-centrality, so that its root is the expected
number of standard errors.

Reference: Hunter and Reiner (1965), Technometrics 7(3), for designs that discriminate between models.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.answer_types import NextExperiment
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, priors
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox, Inputs
from auvnn.simulation.manoeuvres import Manoeuvred, manoeuvres

Array = NDArray[np.float64]
# One run of this length and rate stands for each manoeuvre, s and Hz.
DURATION, RATE = 60.0, 10.0
STEP = 0.05
# Fewer standard errors than this are no promise.
ENOUGH = 3.0


@dataclass(frozen=True)
class Advice:
    """How well each manoeuvre would separate explanations, best first.

    Attributes:
        names: the effects in question.
        ranking: manoeuvre and expected standard errors between the two that it separates worst.
    """

    names: tuple[str, ...]
    ranking: tuple[tuple[str, float], ...]

    def to_dict(self) -> NextExperiment | None:
        """Return `next_experiment` of the public contract; None where nothing can be driven."""
        if not self.ranking:
            return None
        manoeuvre, errors = self.ranking[0]
        return {
            "words": self.words,
            "manoeuvre": manoeuvre,
            "separates": list(self.names),
            "standard_errors": errors,
            "ranking": [{"manoeuvre": m, "standard_errors": e} for m, e in self.ranking],
        }

    @property
    def words(self) -> str:
        """The advice as a sentence."""
        manoeuvre, errors = self.ranking[0]
        apart = " and ".join(self.names) if len(self.names) == 2 else ", ".join(self.names)
        if errors < ENOUGH:
            return (
                f"No manoeuvre of the library would tell {apart} apart: the best, {manoeuvre} "
                f"({WORDS.get(manoeuvre, 'see auvnn simulate')}), reaches {errors:.1f} standard errors in "
                f"{DURATION:g} s. Measure one of them separately."
            )
        return (
            f"Drive {manoeuvre} ({WORDS.get(manoeuvre, 'see auvnn simulate')}) for {DURATION:g} s: it would tell "
            f"{apart} apart by {errors:.0f} standard errors. "
            f"`auvnn simulate excitation={manoeuvre} commands=true` writes the commands."
        )


WORDS = {
    "reciprocal": "the same speed on opposite headings and across",
    "coast_down": "push, then let it coast, one axis after the other",
    "pulses": "short opposite pushes from rest at several levels",
    "oblique": "steady motion at many angles of drift and attack",
    "chirp": "a step and a swept sine along each axis",
    "rotation": "moments about all axes without any force",
    "dives": "steps of depth, slowly ahead",
    "multisine": "all degrees of freedom at once",
}


def advise(
    model: GreyBox,
    layout: Layout,
    rivals: Sequence[FittedHypothesis],
    cut: tuple[float, float],
    progress: Callable[[str], None] | None = None,
    seed: int = 0,
) -> Advice:
    """Rank the library's manoeuvres by how well they would separate explanations.

    Args:
        model: the user's model; manoeuvres are made for it.
        layout: stated values and their uncertainty.
        rivals: at least two fitted explanations.
        cut: length of the windows of free running and of the actuators' history before them, s.
        progress: called with what is being done, in words.
        seed: of the manoeuvres' random parts.
    """
    say = progress or (lambda words: None)
    names = tuple(e.effects[-1] for e in rivals)
    say("planning manoeuvres that would tell them apart")
    plans = manoeuvres(model, DURATION, RATE, seed)
    worst: dict[str, float] = {p.name: np.inf for p in plans}
    bare = [_pruned(e) for e in rivals]
    for k, truth in enumerate(bare):
        say(f"driving them as if {names[k]} were missing")
        log, driven = _logged(truth, plans)
        for p in plans:
            if p.name not in driven:
                worst[p.name] = -np.inf
        if log is None:
            break
        for i, j in permutations(range(len(rivals)), 2):
            if i != k:
                continue
            for name, errors in _against(layout, rivals[j], bare[j], log, driven, cut).items():
                worst[name] = min(worst[name], errors)
    ranking = sorted(((n, float(e)) for n, e in worst.items() if np.isfinite(e)), key=lambda x: -x[1])
    return Advice(names, tuple(ranking))


def _pruned(explanation: FittedHypothesis) -> GreyBox:
    """Return the explanation's model without the effects that it does not use."""
    model = explanation.fitted.model
    return model.rebuilt([e for e in model.copied_effects() if e.name in explanation.names])


def _logged(truth: GreyBox, plans: Sequence[Manoeuvred]) -> tuple[Log | None, list[str]]:
    """Return what each manoeuvre's commands would give, a run each, without noise; and their names in that order."""
    runs, names = [], []
    t = plans[0].t if plans else np.zeros(0)
    if not plans:
        return None, []
    command = torch.tensor(np.stack([p.command for p in plans]))
    fins = None if plans[0].fins is None else torch.tensor(np.stack([np.asarray(p.fins) for p in plans]))
    reference = truth.vehicle.reference_voltage
    voltage = (
        None if reference is None else torch.full(command.shape[:2], float(reference), dtype=command.dtype)
    )
    with torch.inference_mode():
        made = truth.rollout(
            torch.tensor(np.stack([p.eta0 for p in plans])),
            torch.tensor(np.stack([p.nu0 for p in plans])),
            Inputs(command, fins, voltage),
            torch.tensor(t),
            max_step=STEP,
            check=False,
        )
    eta, nu = made.eta.numpy(), made.nu.numpy()
    for k, plan in enumerate(plans):
        if not (np.isfinite(eta[k]).all() and np.isfinite(nu[k]).all() and np.abs(nu[k]).max() < 20.0):
            continue
        runs.append(
            Run(
                number=k,
                t=t,
                quaternion=eta[k, :, 3:],
                nu=nu[k],
                position=eta[k, :, :3],
                wrench=plan.command if truth.actuation == "wrench" else None,
                thrusters=plan.command if truth.actuation == "thrusters" else None,
                fins=plan.fins,
                voltage=None if voltage is None else voltage[k].numpy(),
            )
        )
        names.append(plan.name)
    return (Log.from_runs(runs, name="planned") if runs else None), names


def _against(
    layout: Layout,
    rival: FittedHypothesis,
    model: GreyBox,
    log: Log,
    names: Sequence[str],
    cut: tuple[float, float],
) -> dict[str, float]:
    """Return by manoeuvre the standard errors by which a rival, refitted, would miss these data."""
    windows = cut_windows(log, cut[0], warmup=cut[1], kind=model.actuation)
    states = initial_states(model, windows)
    free = tuple(rival.names)
    # The initial states first, so that what is left is linear in the parameters.
    _, change, _ = normal_equations(windows, linearise(model, windows, states, ()), rival.fitted.sigma)
    states = moved(states, torch.as_tensor(change))
    sums, _, _ = normal_equations(windows, linearise(model, windows, states, free), rival.fitted.sigma)
    precision = priors(layout, free, free=rival.effects).precision
    return {
        name: _left(sums, windows.run == number, precision)
        for number, name in zip(np.unique(windows.run), names, strict=True)
    }


def _left(sums: Statistics, chosen: NDArray[np.bool_], precision: Array) -> float:
    """Return the root of the weighted squared error that no change of the parameters removes.

    Changes are held by the stated uncertainty about the values fitted so far, not by what the first log has told
    of them beyond that: the promise is rather too small than too large.
    """
    hessian = sums.hessian[chosen].sum(0) + np.diag(precision)
    gradient = sums.slope[chosen].sum(0)
    step = np.linalg.lstsq(hessian, gradient, rcond=1e-12)[0] if len(gradient) else gradient
    return float(np.sqrt(max(sums.cost[chosen].sum() - gradient @ step, 0.0)))
