"""Which physical effect is missing? Test all, fit the leading ones, keep what pays on runs left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvnn.checks.doubts import doubts
from auvnn.checks.unmeasured import blind
from auvnn.comparison.baseline import baseline_of
from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.answers.answering import answer
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.hypotheses.candidates import candidates_for
from auvnn.diagnosis.hypotheses.learned_drag import with_drag_only
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.answer import answer_with_force, ends_early
from auvnn.diagnosis.noise_law.commands.stated import stated_commands
from auvnn.diagnosis.search import search
from auvnn.diagnosis.stages.beyond_stated import beyond_stated
from auvnn.diagnosis.stages.runaway import windows_that_hold
from auvnn.diagnosis.stages.shorter_windows import search_over_shorter
from auvnn.diagnosis.stages.state import Searched, Setting
from auvnn.diagnosis.stages.unnamed_effects import beside_unnamed
from auvnn.diagnosis.stages.what_is_left import settled, without_stated
from auvnn.errors import ConfigError, InputError
from auvnn.estimation.prediction_error import SINGULAR
from auvnn.estimation.window_normal_equations import TRUST, motion
from auvnn.executors import Executor, executor_for
from auvnn.executors.serial import SERIAL
from auvnn.logs import Log
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.unmeasured import assumed, completed
from auvnn.models import GreyBox
from auvnn.models.engine import slower
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.progress import Counted
from auvnn.threads import on_one_thread
from auvnn.training.confounding.confounded_effects import confounded_effects

LEARNED = (
    "of the learned damping only what drag can be was kept for the tests, and that was left uncertain; "
    "after adding what is named, train the subnetworks again with it in the model"
)


@on_one_thread
def diagnose(
    model: GivenModel,
    log: GivenLog,
    effects: str | Sequence[str] | None = None,
    *,
    max_effects: int = 4,
    window: float | None = None,
    advice: bool = True,
    whiteness: bool = True,
    stochastic: bool = True,
    force: bool = False,
    tolerance: Any = None,
    costs: bool = True,
    workers: int = 1,
    executor: str | None = None,
    address: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> Diagnosis:
    """Say which physical effects a model lacks, by a log.

    A global test decides whether anything is missing; only then are names tried. Each is fitted jointly with
    the coefficients that are uncertain, weighed by its evidence, and kept only if free running on runs left
    out improves by more than its own uncertainty. Then the search goes on with the effect in the model.

    Args:
        model: the model as known.
        log: measurements; cross-validated over its runs. A test log has no place here.
        effects: names to consider; the whole catalogue by default.
        max_effects: look for at most this many.
        window: length of the windows of free running that are fitted, s; by default 5.
        advice: for an ambiguous answer, also work out which manoeuvre would tell the candidates apart.
        whiteness: also test what is left for correlations, before and after; no verdict depends on these tests.
        stochastic: where a force is left without a name, also ask how commands go between samples, and compare the
            effects again together with a stochastic force whose law is estimated; takes as long again. Without it
            commands go between samples as the model states.
        force: go on with a log that contradicts itself: signs, units, axes.
        tolerance: what does not matter: a number for the cost in free running, with a fifth of it for the force as a
            share of the actuators', or a mapping with `cost` and `force`; by default 0.1 and 0.02. At 0 everything
            matters that is there.
        costs: also work out what each name costs in free running, which takes about as long as naming it. Several names
            are told in the order that follows, and not those that are not known to improve predictions beside the first.
        workers: how many fit effects side by side; the answer is the same. Worth it where a diagnosis takes minutes.
        executor: who fits: `serial`, `processes`, `ray` or `dask`; by default processes where there are several workers.
        address: of a Ray or Dask cluster that is running.
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an unknown effect or executor, or fewer than one worker.
        InputError: the log has too little that can be used, or contradicts itself.

    Example:
        ```python
        model = auvnn.load("rov95")
        log = auvnn.simulate(model, noise="realistic", hidden={"ocean_current": {"v_north": 0.2}}).log
        diagnosis = auvnn.diagnose(model, log, ["ocean_current", "net_buoyancy"])
        diagnosis.verdict, diagnosis.missing  # "named", ["ocean_current"]
        ```
    """
    log = as_log(log)
    model = as_model(model, log)
    with executor_for(executor, workers, address) as pool:
        return searched(
            model,
            log,
            effects,
            max_effects=max_effects,
            window=window,
            advice=advice,
            whiteness=whiteness,
            stochastic=stochastic,
            force=force,
            tolerance=tolerance,
            costs=costs,
            pool=pool,
            progress=progress,
        )[0]


def searched(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str] | None = None,
    *,
    max_effects: int = 4,
    window: float | None = None,
    advice: bool = True,
    whiteness: bool = True,
    stochastic: bool = True,
    force: bool = False,
    tolerance: Any = None,
    costs: bool = True,
    pool: Executor = SERIAL,
    progress: Callable[[str], None] | None = None,
) -> tuple[Diagnosis, Searched]:
    """Return what `diagnose` does, and the search that led to it.

    Args:
        model: as known; it is not changed.
        log: measurements.
        effects: names that may be missing; the whole catalogue by default.
        max_effects: name at most this many.
        window: length of the windows, s; chosen by the log's rate where None.
        advice: say what to drive next where names cannot be told apart.
        whiteness: test what is left for structure.
        stochastic: allow for a force that wanders.
        force: go on with a log that contradicts itself: signs, units, axes.
        tolerance: what counts as small: a `Tolerance`, its options, or None.
        costs: say what each name costs in free running.
        pool: who makes fits of which none has to wait for another.
        progress: called with what is being done, in words.
    """
    say = Counted(progress, 8 + 4 * bool(costs) + bool(whiteness) + 3 * bool(advice), rough=True)
    if max_effects < 1:
        raise ConfigError(f"max_effects={max_effects} must be at least 1")
    log = completed(model, log)
    usable, needs = candidates_for(model, log, effects, stated=True)
    log.quality().refuse_contradictions(force)
    allowed = Tolerance.of(tolerance)
    # What subnetworks have absorbed leaves no residual: only what drag can be is kept of them.
    known, spread = with_drag_only(model, log)
    driven = None if stochastic else model
    windows, notes = windows_that_hold(known, log, window, driven)
    layout = lay_out(known, usable, spread)
    absorbed = confounded_effects(model, log)
    notes += [] if spread is None else [LEARNED]
    notes += [] if absorbed is None else absorbed.words()
    notes += slower(known.without_absent(), windows.inputs, len(windows))
    asked = Setting(
        model=model,
        log=log,
        layout=layout,
        usable=tuple(usable),
        needs=needs,
        base=tuple(n for n in layout.names if n not in usable or n in layout.nuisance),
        floor=TRUST * motion(windows) + 1e-9,
        most=max_effects,
        tolerance=allowed,
        costs=costs,
        advice=advice,
        whiteness=whiteness,
        absorbed=absorbed,
        notes=(*assumed(log, model), *blind(log), *notes, *doubts(model, log)),
        say=say,
        pool=pool,
        driven=driven,
        commands=stated_commands(known, windows) if stochastic else None,
    )
    try:
        begin = windows if asked.commands is None else asked.commands.law.applied(windows)
        state, told, words = search(asked, begin, until=ends_early if stochastic else None), {}, []
        if window is None:
            asked, state = search_over_shorter(asked, state, search)
        if stochastic:
            state, told, words = answer_with_force(asked, state)
            # However commands have turned out to go, what is told of the answer is worked out with such commands.
            asked = asked.with_commands(state.current.fitted.model.commands)
        state = beside_unnamed(asked, beyond_stated(asked, without_stated(asked, settled(asked, state))))
        found = answer(asked, state)
    except (np.linalg.LinAlgError, SINGULAR) as problem:
        raise InputError(
            f"{log.name} cannot be diagnosed with {model.vehicle.name}: free running grows without bound, so that the "
            f"sums of its tests cannot be solved ({problem}); choose shorter windows with window=, and check the model"
        ) from None
    found = replace(
        found,
        baseline=baseline_of(model, log, choose_derivative(log)),
        stochastic=told,
        warnings=[*found.warnings, *words],
    )
    return found, Searched(asked, state)
