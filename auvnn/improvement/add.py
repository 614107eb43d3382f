"""Add effects to a model, refit, and compare before and after on data that was held out: fit, judge, assemble."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from auvnn.answer_types import WaterfallStep
from auvnn.catalogue import unknown_name
from auvnn.comparison.baseline import compare_with_baseline
from auvnn.comparison.compare import floor_of
from auvnn.comparison.predictions import stitch
from auvnn.diagnosis.answers.answer import Names, OneOf
from auvnn.diagnosis.answers.table import values
from auvnn.diagnosis.cross_validation.fitters import OBJECTIVES
from auvnn.diagnosis.one_step.fit import left_out_gain
from auvnn.effects import effect_class
from auvnn.effects.acting_beside import in_words, needed_beside
from auvnn.effects.registering import names_of
from auvnn.errors import ConfigError
from auvnn.improvement.added import Improvement
from auvnn.improvement.commands_between import by_their_path
from auvnn.improvement.fits import GIVEN, REFITTED, Fits, fit_steps, unseen
from auvnn.improvement.held_out import Judged, judge, words
from auvnn.logs import Log
from auvnn.logs.leakage import leakage
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.noise_floor import noise_floor
from auvnn.metrics.rollouts import HORIZONS
from auvnn.metrics.unmeasured import assumed, completed
from auvnn.models import GreyBox
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.progress import Progress
from auvnn.threads import on_one_thread

THERE = "the model has {0} already: refit=true fits it anew; or remove it first, or name another effect"


@on_one_thread
def add(
    model: GivenModel,
    log: GivenLog,
    effects: str | Sequence[str],
    *,
    test: GivenLog | None = None,
    derivative: dict[str, Any] | None = None,
    window: float | None = None,
    force: bool = False,
    objective: str = "rollout",
    horizons: Sequence[str] = HORIZONS,
    refit: bool = False,
    progress: Callable[[str], None] | None = None,
) -> Improvement:
    """Add effects, fit them jointly with the uncertain coefficients on `log`, and judge on held-out data.

    Args:
        model: the model as known; it is not changed.
        log: what to fit on.
        effects: names; of names between which a diagnosis could not decide, the first is taken.
        test: what to judge on; by default the last run of `log`, or the last 30 % of a single one.
        derivative: how accelerations are obtained where they were not measured.
        window: length of the windows of free running that are fitted, s; by default 5.
        force: go on with a log that contradicts itself: signs, units, axes.
        objective: "rollout" fits the error of free-running windows; "one_step" that of the acceleration one
            step ahead, which is better where lasting disturbances, not sensors, limit the prediction.
        horizons: of free running on the held-out data, s, "5" among them; fewer take less time.
        refit: whether effects that the model has already may be among them: they are fitted anew, whatever was stated of
            them. What a diagnosis has found to contradict the model (`Diagnosis.missing`) may be.
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an unknown effect or objective, an effect that is there already, or one named twice.
        InputError: the same data on both sides, `log` says nothing about an effect, or contradicts itself.

    Example:
        ```python
        model = auvnn.load("rov95")
        log = auvnn.simulate(model, noise="realistic", hidden={"ocean_current": {"v_north": 0.2}}).log
        better = auvnn.add(model, log, "ocean_current")
        better.accepted, better.gain, better.parameters["ocean_current"]
        ```
    """
    log = as_log(log)
    model = as_model(model, log)
    test = None if test is None else as_log(test, "test")
    say = progress or (lambda words: None)
    names, notes = _wanted(names_of(effects))
    _check_request(model, names, refit or (isinstance(effects, Names) and effects.refit))
    held_out = f"{test.name} is held out" if test is not None else ""
    log, test = completed(model, log), None if test is None else completed(model, test)
    if test is None:
        log, test, held_out = log.split()
    else:
        leakage(log, test)
        test.quality().refuse_contradictions(force)
    log.quality().refuse_contradictions(force)
    if objective not in OBJECTIVES:
        raise ConfigError(unknown_name("objective", str(objective), OBJECTIVES))
    if "5" not in horizons:
        raise ConfigError(f"horizons={list(horizons)}: '5' must be among them, the gain is measured there")
    fits = fit_steps(model, log, names, objective=objective, window=window, derivative=derivative, say=say)
    fits = by_their_path(fits, model, names, say)
    notes += [*fits.notes, *unseen(fits.layout, fits.best, names, log)]
    steps = 2 * len(names) + 1 if len(names) > 1 else 3
    say(Progress("free running on the held-out data", steps - 1, steps))
    judged = judge(fits, names, test, horizons, derivative, objective == "one_step")
    return _assembled(model, log, test, names, fits, judged, objective, held_out, notes, derivative)


def _wanted(effects: str | Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the names to add, and what to say about the choice."""
    if isinstance(effects, str):
        return [effects], []
    if isinstance(effects, OneOf) and len(effects) > 1:
        first, *others = effects
        return [first], [
            f"the log cannot tell {first} from {', '.join(others)}: {first} was added, the others not"
        ]
    return list(effects), []


def _assembled(
    model: GreyBox,
    log: Log,
    test: Log,
    names: list[str],
    fits: Fits,
    judged: Judged,
    objective: str,
    held_out: str,
    notes: list[str],
    derivative: dict[str, Any] | None,
) -> Improvement:
    """Return the answer."""
    layout, best, last, key = fits.layout, fits.best, names[-1], judged.key
    results, rolled = judged.results, judged.rolled
    waterfall: list[WaterfallStep] = [
        {"step": s, "error": results[s]["rollout"][key]["total"]} for s, _ in fits.steps
    ]
    for horizon, free in rolled[last].items():
        results[last]["rollout"][horizon]["noise_floor"] = floor_of(fits.final, free, test, judged.scale)
    waterfall.append(
        {"step": "noise floor", "error": noise_floor(fits.final, rolled[last][key], test, judged.scale)}
    )
    said = [w for w in (fits.final.effect(n).words() for n in names) if w]
    warnings = [
        *log.quality().reservations,
        *assumed(log, model),
        *said,
        *notes,
        *words(layout, best, judged),
    ]
    if key != "5":
        warnings.append(f"no held-out stretch is 5 s long: gain and waterfall are for horizon {key}")
    one_step = objective == "one_step"
    return Improvement(
        name=model.vehicle.name,
        log=log.name,
        test=test.name,
        effects=names,
        accepted=judged.accepted,
        before=results[GIVEN],
        refitted=results[REFITTED],
        after=results[last],
        gain={"value": judged.gain[0], "std": judged.gain[1]},
        waterfall=waterfall,
        parameters=values(layout, best, names),
        coefficients=values(
            layout, best, [n for n in layout.nuisance if n not in (*names, *model.effect_names)]
        ),
        held_out=held_out,
        model=fits.final,
        refitted_model=fits.steps[1][1],
        warnings=warnings,
        series=[
            {
                "run": run.number,
                "t": run.t,
                "measured": run.measured.nu,
                "before": stitch(rolled[GIVEN][key], run.number, run.nu),
                "refitted": stitch(rolled[REFITTED][key], run.number, run.nu),
                "after": stitch(rolled[last][key], run.number, run.nu),
            }
            for run in test.runs
        ],
        objective=objective,
        left_out=left_out_gain(fits.fits[0], best) if one_step else None,
        steps=[
            {
                "step": step,
                **results[step],
                "left_out": {
                    by: left_out_gain(fits.fits[k - 2], fits.fits[k - 1], by) for by in ("run", "fifth")
                }
                if one_step and k > 1
                else None,
                "model": candidate,
            }
            for k, (step, candidate) in enumerate(fits.steps)
        ],
        by_effect=judged.by_effect,
        commands=None if fits.final.commands is None else fits.final.commands.to_dict(),
        baseline=compare_with_baseline(
            rolled[last],
            model.actuation,
            judged.scale,
            log,
            choose_derivative(log, derivative),
            left_out=False,
        ),
    )


def _check_request(model: GreyBox, names: list[str], refit: bool) -> None:
    if not names:
        raise ConfigError("no effect to add: name one, for example effect=ocean_current")
    for name in names:
        effect_class(name)
        if names.count(name) > 1:
            raise ConfigError(f"effect {name} is named twice: name it once")
        if name in model.effect_names and not refit:
            raise ConfigError(THERE.format(name))
        needed = needed_beside(name, (*names, *model.effect_names))
        if needed:
            raise ConfigError(f"{name} does nothing by itself: add {in_words(needed)} with it")
