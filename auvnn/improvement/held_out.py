"""What the models of `add` do on held-out data: figures, falls with their uncertainties, and what is accepted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from auvnn.answer_types import OwnFall
from auvnn.diagnosis.answers.bounds import reservations
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.improvement.fits import REFITTED, Fits
from auvnn.improvement.gains import paired_gain
from auvnn.logs import Log
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.one_step import one_step, scores
from auvnn.metrics.rollouts import Rolled, Scale, roll, rollout_table, scale_of

# Pairs of parameters that the log cannot tell apart: their correlation, and how many are reported.
ALIKE, TOLD = 0.99, 5


@dataclass(frozen=True)
class Judged:
    """Models on held-out data.

    Attributes:
        results: step to its figures.
        rolled: step to its free runs, by horizon.
        key: the horizon of the gain, s.
        scale: what errors are measured by.
        gain: fall of the total from the refitted model to the one with all effects, and its standard error.
        by_effect: effect to the same for it alone, in addition to the others.
    """

    results: dict[str, dict[str, Any]]
    rolled: dict[str, dict[str, Rolled]]
    key: str
    scale: Scale
    gain: tuple[float, float]
    by_effect: dict[str, OwnFall]

    @property
    def accepted(self) -> bool:
        """Whether all effects together pay, and each in addition to the others."""
        return _pays(*self.gain) and all(entry["accepted"] for entry in self.by_effect.values())


def judge(
    fits: Fits,
    names: Sequence[str],
    test: Log,
    horizons: Sequence[str],
    derivative: dict[str, Any] | None,
    thorough: bool,
) -> Judged:
    """Run all models free on held-out data, and ask of each effect what it brings in addition to the others.

    Args:
        fits: the models.
        names: the effects.
        test: held-out data.
        horizons: of free running, s.
        derivative: how accelerations are obtained.
        thorough: give all figures of every step, not of the first two and the last alone.
    """
    scale, how = scale_of(test), choose_derivative(test, derivative)
    results: dict[str, dict[str, Any]] = {}
    rolled: dict[str, dict[str, Rolled]] = {}
    key = "5"
    for k, (step, model) in enumerate(fits.steps):
        whole = thorough or k < 2 or k == len(fits.steps) - 1
        rollout, kept = rollout_table(model, test, scale, tuple(horizons) if whole else (key,))
        results[step] = {"rollout": rollout}
        rolled[step] = kept
        if key not in kept:
            # The held-out stretches are shorter than that: the longest horizon that they bear.
            key = next((h for h in ("2", "1", "0.5") if h in kept), "full")
        if whole:
            results[step]["one_step"] = scores(one_step(model, test, how))
    last = rolled[names[-1]][key]
    gain = paired_gain(rolled[REFITTED][key], last, scale)
    by_effect: dict[str, OwnFall] = {}
    for name in names:
        own, minded = gain, reservations(fits.layout, fits.best, [name])
        if len(names) > 1:
            less = roll(fits.without[name], test, key, scale)
            own = (float("nan"), float("inf")) if less is None else paired_gain(less, last, scale)
        by_effect[name] = {
            "gain": {"value": own[0], "std": own[1]},
            "accepted": _pays(*own),
            "reservations": minded,
        }
    return Judged(results, rolled, key, scale, gain, by_effect)


def words(layout: Layout, found: FittedHypothesis, judged: Judged) -> list[str]:
    """Return what to mind: what is not accepted and why, parameters at their bounds, and such as are alike.

    Args:
        layout: bounds of the parameters.
        found: the fit with everything.
        judged: what it is worth on held-out data.
    """
    out = []
    value, std = judged.gain
    if not _pays(value, std):
        out.append(f"not accepted: the held-out error falls by {value:.3g}, its own uncertainty is {std:.3g}")
    if len(judged.by_effect) > 1:
        for name, entry in judged.by_effect.items():
            if not entry["accepted"]:
                own = entry["gain"]
                fall = (
                    f"in addition to the others it lets the held-out error fall by {own['value']:.3g}, with an "
                    f"uncertainty of {own['std']:.3g}"
                )
                if not np.isfinite(own["value"]):
                    fall = "without it free running grows without bound, so that its share cannot be judged"
                out.append(f"{name} is not known to improve the prediction: {fall}")
    out += reservations(layout, found, found.names)
    covariance = found.fitted.covariance()
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    rho = covariance / size[:, None] / size
    labels = [f"{n}.{p.name}" for n in found.names for p in layout.model.effect(n).parameters_of]
    pairs = [(i, j) for i in range(len(labels)) for j in range(i) if abs(rho[i, j]) > ALIKE]
    for i, j in pairs[:TOLD]:
        out.append(
            f"{labels[j]} and {labels[i]} cannot be told apart on this log (correlation {rho[i, j]:.3f})"
        )
    return out


def _pays(value: float, std: float) -> bool:
    return bool(np.isfinite(value) and value > std)
