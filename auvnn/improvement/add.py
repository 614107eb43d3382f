"""Add effects to a model, refit, and compare before and after on data that was held out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answers import Answer, plain
from auvnn.catalogue import unknown_name
from auvnn.comparison.compare import stitch
from auvnn.diagnosis.answers.table import values
from auvnn.diagnosis.hypotheses.bake import with_fitted_parameters
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, determined, fit_hypothesis
from auvnn.diagnosis.hypotheses.layout import Layout, lay_out
from auvnn.diagnosis.one_step.fit import fit_hypothesis_one_step, left_out_gain
from auvnn.diagnosis.score_tests.probes import null_is_no_start
from auvnn.diagnosis.score_tests.shape_search import search_shapes
from auvnn.effects import effect_class
from auvnn.errors import ConfigError, InputError
from auvnn.improvement.gains import noise_floor, paired_gain
from auvnn.logs import Log
from auvnn.logs.leakage import leakage
from auvnn.metrics.one_step import choose_derivative, one_step, scores
from auvnn.metrics.rollouts import HORIZONS, rollout_table, scale_of
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Layout, effects that are free anyway, effects asked for, the fit to start from.
Fit = Callable[[Layout, Sequence[str], Sequence[str], FittedHypothesis | None], FittedHypothesis]
OBJECTIVES = ("rollout", "one_step")


@dataclass
class Improvement(Answer):
    """What adding effects did; `to_dict` is `improvement.json` of the public contract.

    Attributes:
        model: name of the model before.
        accepted: whether the held-out error fell by more than its own uncertainty.
        better: the model with the effects.
        refitted_model: the model as given, its uncertain coefficients refitted.
        left_out: where one-step errors were fitted, their weighted size on runs of `log` left out in turn: before
            and after, the fall and its standard error; None otherwise. It never saw the test log.
        steps: the models of the waterfall one by one: their held-out figures, and what `left_out` is from each to
            the next, by "run" and by "fifth" of every run.
    """

    kind = "improvement"
    name: str
    log: str
    test: str
    effects: list[str]
    accepted: bool
    before: dict[str, Any]
    refitted: dict[str, Any]
    after: dict[str, Any]
    gain: dict[str, float]
    waterfall: list[dict[str, Any]]
    parameters: dict[str, dict[str, dict[str, Any]]]
    coefficients: dict[str, dict[str, dict[str, Any]]]
    held_out: str
    model: GreyBox
    refitted_model: GreyBox
    warnings: list[str] = field(default_factory=list)
    series: list[dict[str, Any]] = field(default_factory=list)
    objective: str = "rollout"
    left_out: dict[str, float] | None = None
    steps: list[dict[str, Any]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "log",
            "test",
            "effects",
            "accepted",
            "before",
            "refitted",
            "after",
            "gain",
            "waterfall",
            "parameters",
            "coefficients",
            "held_out",
            "objective",
            "left_out",
            "warnings",
        )
        return plain(
            {"schema": "auvnn/improvement/1", "model": self.name, **{n: getattr(self, n) for n in names}}
        )


def add(
    model: GreyBox,
    log: Log,
    effects: str | Sequence[str],
    *,
    test: Log | None = None,
    derivative: dict[str, Any] | None = None,
    window: float | None = None,
    force: bool = False,
    objective: str = "rollout",
    horizons: Sequence[str] = HORIZONS,
    progress: Callable[[str], None] | None = None,
) -> Improvement:
    """Add effects, fit them jointly with the uncertain coefficients on `log`, and judge on held-out data.

    Args:
        model: the model as known; it is not changed.
        log: what to fit on.
        effects: names.
        test: what to judge on; by default the last run of `log`, or the last 30 % of a single one.
        derivative: how accelerations are obtained where they were not measured.
        window: length of the windows of free running that are fitted, s; by default 5.
        force: go on with a log that contradicts itself: signs, units, axes.
        objective: "rollout" fits the error of free-running windows; "one_step" that of the acceleration one
            step ahead, which is better where lasting disturbances, not sensors, limit the prediction.
        horizons: of free running on the held-out data, s, "5" among them; fewer take less time.
        progress: told in words what is being done.

    Raises:
        ConfigError: an unknown effect or objective, an effect that is there already, or one named twice.
        InputError: the same data on both sides, `log` says nothing about an effect, or contradicts itself.
    """
    say = progress or (lambda words: None)
    names = [effects] if isinstance(effects, str) else list(effects)
    _check_request(model, names)
    held_out = f"{test.name} is held out" if test is not None else ""
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
    if objective == "one_step" and window is not None:
        raise ConfigError("window= belongs to objective=rollout: leave it out, or fit windows")
    layout = lay_out(model, names)
    fit = _by_one_step(log, derivative) if objective == "one_step" else _by_windows(model, log, window)
    base = [n for n in layout.names if n not in names or n in layout.nuisance]
    say("refitting the uncertain coefficients alone")
    # A coefficient group that is itself to be added stays as stated in the model that is compared with.
    nothing = fit(layout, [n for n in base if n not in names], (), None)
    models, fits = (
        [("as given", model), ("coefficients refitted", with_fitted_parameters(model, layout, nothing))],
        [nothing],
    )
    for count in range(1, len(names) + 1):
        say(f"fitting with {', '.join(names[:count])}")
        found = fit(layout, base, names[:count], fits[-1])
        fits.append(found)
        models.append((names[count - 1], with_fitted_parameters(model, layout, found)))
    final, best = models[-1][1], fits[-1]
    silent = _silent(layout, best, names, log)
    say("free running on the held-out data")
    scale, how = scale_of(test), choose_derivative(test, derivative)
    results, rolled, key = {}, {}, "5"
    for step, candidate in models:
        whole = step in ("as given", "coefficients refitted") or candidate is final
        rollout, kept = rollout_table(
            candidate, test, scale, tuple(horizons) if whole or objective == "one_step" else (key,)
        )
        results[step] = {"rollout": rollout}
        rolled[step] = kept
        if key not in kept:
            # The held-out stretches are shorter than that: the longest horizon that they bear.
            key = next((h for h in ("2", "1", "0.5") if h in kept), "full")
        if whole or objective == "one_step":
            results[step]["one_step"] = scores(one_step(candidate, test, how))
    last = names[-1]
    gain, std = paired_gain(rolled["coefficients refitted"][key], rolled[last][key], scale)
    accepted = bool(np.isfinite(gain) and gain > std)
    waterfall = [{"step": s, "error": results[s]["rollout"][key]["total"]} for s, _ in models]
    waterfall.append({"step": "noise floor", "error": noise_floor(final, rolled[last][key], test, scale)})
    said = [w for w in (final.effect(n).words() for n in names) if w]
    warnings = [*log.quality().reservations, *said, *silent, *_warnings(layout, best, accepted, gain, std)]
    if key != "5":
        warnings.append(f"no held-out stretch is 5 s long: gain and waterfall are for horizon {key}")
    return Improvement(
        model.vehicle.name,
        log.name,
        test.name,
        names,
        accepted,
        results["as given"],
        results["coefficients refitted"],
        results[last],
        {"value": gain, "std": std},
        waterfall,
        values(layout, best, names),
        values(layout, best, [n for n in layout.nuisance if n not in names]),
        held_out,
        final,
        models[1][1],
        warnings,
        [
            {
                "run": run.number,
                "t": run.t,
                "measured": run.nu,
                "before": stitch(rolled["as given"][key], run.number, run.nu),
                "refitted": stitch(rolled["coefficients refitted"][key], run.number, run.nu),
                "after": stitch(rolled[last][key], run.number, run.nu),
            }
            for run in test.runs
        ],
        objective,
        left_out_gain(nothing, best) if objective == "one_step" else None,
        [
            {
                "step": step,
                **results[step],
                "left_out": {by: left_out_gain(fits[k - 2], fits[k - 1], by) for by in ("run", "fifth")}
                if objective == "one_step" and k > 1
                else None,
                "model": candidate,
            }
            for k, (step, candidate) in enumerate(models)
        ],
    )


def _by_windows(model: GreyBox, log: Log, window: float | None) -> Fit:
    windows = windows_for(model, log, window)

    def fit(
        layout: Layout, base: Sequence[str], effects: Sequence[str], before: FittedHypothesis | None
    ) -> FittedHypothesis:
        looked = before is not None and bool(effects) and null_is_no_start(layout, effects[-1])
        guess = search_shapes(layout, windows, before, base).start(effects[-1]) if before and looked else None
        start = None if before is None else before.fitted
        return fit_hypothesis(layout, windows, base, effects, start=start, guess=guess)

    return fit


def _by_one_step(log: Log, derivative: dict[str, Any] | None) -> Fit:
    how = choose_derivative(log, derivative)
    # The slope of a velocity that leaves its neighbours for one sample is no acceleration.
    log = replace(log, runs=tuple(run.cleaned for run in log.runs))

    def fit(
        layout: Layout, base: Sequence[str], effects: Sequence[str], before: FittedHypothesis | None
    ) -> FittedHypothesis:
        for name in effects:
            if any(p.shape for p in layout.model.effect(name).parameters_of):
                raise ConfigError(
                    f"{name} has a time or a shape to be found, which objective=one_step cannot: take objective=rollout"
                )
        start = None if before is None else before.fitted
        return fit_hypothesis_one_step(layout, log, base, effects, how, start=start)

    return fit


def _check_request(model: GreyBox, names: list[str]) -> None:
    if not names:
        raise ConfigError("no effect to add: name one, for example effect=ocean_current")
    for name in names:
        effect_class(name)
        if names.count(name) > 1:
            raise ConfigError(f"effect {name} is named twice: name it once")
        if name in model.effect_names:
            raise ConfigError(f"the model has {name} already: remove it first, or name another effect")


def _silent(layout: Any, found: FittedHypothesis, names: Sequence[str], log: Log) -> list[str]:
    """Return a warning where the log says nothing about some parameters; refuse where it is all of an effect's."""
    out, places = [], layout.places(found.names)
    for name in names:
        known = determined(found, places[name])
        if known.all():
            continue
        dark = [
            f"{name}.{p.name}"
            for p, k in zip(layout.model.effect(name).parameters_of, known, strict=True)
            if not k
        ]
        more = f" and {len(dark) - 8} more" if len(dark) > 8 else ""
        labels = ", ".join(dark[:8]) + more
        if not known.any():
            raise InputError(
                f"{log.name} says nothing about {labels}: nothing in it depends on {'it' if len(dark) == 1 else 'them'}; "
                f"fit on a log with another motion, or leave {name} out"
            )
        out.append(
            f"{log.name} says nothing about {labels}: they stay near where they were, without standard error"
        )
    return out


def _warnings(layout: Any, found: FittedHypothesis, accepted: bool, gain: float, std: float) -> list[str]:
    out = []
    if not accepted:
        out.append(f"not accepted: the held-out error falls by {gain:.3g}, its own uncertainty is {std:.3g}")
    if not found.fitted.converged:
        out.append("the fit had not settled when it was stopped: read the parameters with care")
    at = 0
    for name in found.names:
        for p in layout.model.effect(name).parameters_of:
            value = found.fitted.theta[at]
            at += 1
            at_bound = value <= p.low + 1e-9 * abs(p.low) or value >= p.high - 1e-9 * abs(p.high)
            if at_bound and value != p.null:
                out.append(f"{name}.{p.name} ended at its bound {value:g} {p.unit}: the data ask for more")
    covariance = found.fitted.covariance()
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    rho = covariance / size[:, None] / size
    labels = [f"{n}.{p.name}" for n in found.names for p in layout.model.effect(n).parameters_of]
    pairs = [(i, j) for i in range(len(labels)) for j in range(i) if abs(rho[i, j]) > 0.99]
    for i, j in pairs[:5]:
        out.append(
            f"{labels[j]} and {labels[i]} cannot be told apart on this log (correlation {rho[i, j]:.3f})"
        )
    return out
