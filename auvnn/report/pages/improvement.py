"""The page of `add`: the error before and after on data that nothing was fitted on."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.cards import not_needed, still_beaten
from auvnn.report import style
from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.panels import NoData
from auvnn.report.plots.before_after import before_after
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.plots.error_over_time import error_over_time
from auvnn.report.plots.parameters import parameters
from auvnn.report.plots.waterfall import FLOOR, waterfall
from auvnn.report.view import View
from auvnn.report.words import finite, interval, listing, number, percent

STAGES = {"before": "as given", "refitted": "refitted", "after": "after"}
WHOLE_RUNS = 3
FEW_VALUES = 4  # of an effect, that a sentence can hold


class ImprovementPage(Page):
    """What adding effects gained."""

    kind = "improvement"

    def title(self, view: View) -> str:
        """Return the heading."""
        return f"{listing(view.texts('effects')) or 'Effects'} added: before and after"

    def about(self, view: View) -> str:
        """Return model, log and what was held out."""
        held = f", judged on {view.text('test')}" if view.text("test") else ""
        return f"{view.text('model', 'a model')}, fitted on {view.text('log', 'a log')}{held}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        effects = listing(view.texts("effects")) or "the effects"
        gain, steps = view.mapping("gain"), _steps(view)
        fall, std = finite(gain.get("value")), finite(gain.get("std"))
        errors = {stage: _main_error(view, stage) for stage in STAGES}
        idle = not_needed(gain, view.mapping("by_effect"))
        out = [_verdict(effects, bool(view.get("accepted")), fall, std, idle)]
        beaten = still_beaten(view.mapping("baseline"))
        out += [f"{beaten[0].upper()}{beaten[1:].replace('`', '')}."] if beaten else []
        out += [*_error_words(view, effects, errors), *common.baseline_words(view)]
        out += _floor_words(steps, errors)
        return [*out, *_fitted_words(view.mapping("parameters")), *_channel_words(view)]

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        series = common.arrays(view.items("series"))

        @functools.cache
        def part() -> dict[str, Any]:
            return common.excerpt(series[common.worst_run(series, "before")], "before")

        plots = [
            Plot(
                "before_after",
                "Before and after, on a held-out run",
                lambda: _runs(part(), whole=False),
                lambda: _series_caption(part()),
            ),
            Plot(
                "waterfall",
                "From the model as given to the noise floor",
                lambda: waterfall(_steps(view)),
                lambda: _waterfall_caption(_steps(view)),
            ),
            Plot(
                "error_against_horizon",
                "Error against horizon",
                lambda: _horizons(view),
                "Error of free running on held-out data, averaged over the channels that move. The added "
                "effect is worth what lies between the refitted and the last line: refitting alone is not "
                "to its credit. Noise alone would leave a perfect model at the grey line.",
            ),
            Plot(
                "parameters",
                "What was fitted",
                lambda: parameters(view.mapping("parameters"), view.get("truth")),
                common.INTERVALS,
                lone=True,
            ),
            Plot(
                "error_over_time",
                "What is left of the error",
                lambda: _errors(part()),
                "Model minus measurement over the same stretch. What still grows between two restarts is "
                "not noise.",
                folded=True,
            ),
        ]
        for entry in series[:WHOLE_RUNS]:
            title = f"The whole of held-out {common.run_words(entry, whole=True)}"
            draw = functools.partial(_runs, entry, whole=True)
            plots.append(Plot(common.run_file(entry), title, draw, common.THINNED, folded=True))
        return plots

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        refitted = view.mapping("coefficients")
        steps = [[str(s.get("step") or "–"), number(s.get("error"))] for s in _steps(view)]
        return [
            common.parameter_table(view.mapping("parameters")),
            HtmlTable(
                "Coefficients fitted with it",
                common.PARAMETER_HEAD,
                common.parameter_rows(refitted),
                words=2,
                folded=True,
            ),
            _stage_table(view, "rollout", "Free-running error over {} by channel", "nrmse"),
            _stage_table(view, "one_step", "R² of the acceleration, one step ahead", "r2"),
            HtmlTable("Error step by step", ["step", "error"], steps),
            common.baseline_table(view),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        return [
            ("Model", view.text("model")),
            ("Fitted on", view.text("log")),
            ("Held out", view.text("held_out") or view.text("test")),
            ("Effects", listing(view.texts("effects"))),
            ("Error", "rms over free-running windows of 5 s, as a share of each channel's spread"),
            ("Gain", "from the refitted to the extended model; one standard deviation over windows and runs"),
        ]


def _fitted_words(fitted: Mapping[str, Any]) -> list[str]:
    """Return the values of the effects that have few of them; tables hold the others."""
    few = [f"{e}: {common.parameter_words(m)}" for e, m in fitted.items() if m and len(m) <= FEW_VALUES]
    many = [str(e) for e, m in fitted.items() if m and len(m) > FEW_VALUES]
    out = [f"Fitted: {'; '.join(few)}."] if few else []
    if many:
        out.append(f"The values of {listing(many)} stand in the table of fitted parameters.")
    return out


def _verdict(effects: str, accepted: bool, fall: float | None, std: float | None, idle: str) -> str:
    share, own = (None if x is None else 100.0 * x for x in (fall, std))
    size = interval(share, own, "% of the spread of the motion")
    by = f" by {size}" if fall is not None else ""
    lowers = f"Adding {effects} lowers the error on held-out data{by}"
    if accepted:
        return f"{lowers}, more than its own uncertainty: accepted."
    if idle:
        return f"{lowers}, but {idle}. Not accepted as it is."
    if fall is not None and fall <= 0:
        return f"Adding {effects} does not lower the error on held-out data (gain {size}): not accepted."
    return f"{lowers}, no more than chance could: not accepted."


def _error_words(view: View, effects: str, errors: Mapping[str, float | None]) -> list[str]:
    before, refitted, after = (errors[stage] for stage in STAGES)
    if before is None or after is None:
        return []
    span = common.horizon_words(common.main_horizon(_stage(view, "after", "rollout")) or "")
    middle = f", by {percent(refitted)} with its coefficients fitted again" if refitted is not None else ""
    return [
        f"Running free for {span}, the model as given errs by {percent(before)} of the spread of the "
        f"motion{middle}, and by {percent(after)} with {effects}."
    ]


def _steps(view: View) -> list[Mapping[str, Any]]:
    return [s for s in view.items("waterfall") if isinstance(s, Mapping)]


def _stage(view: View, stage: str, part: str) -> Mapping[str, Any]:
    found = view.mapping(stage).get(part)
    return found if isinstance(found, Mapping) else {}


def _main_error(view: View, stage: str) -> float | None:
    rollout = _stage(view, stage, "rollout")
    return common.total(rollout, common.main_horizon(rollout))


def _floor_words(steps: list[Mapping[str, Any]], errors: Mapping[str, float | None]) -> list[str]:
    floor = next((finite(s.get("error")) for s in steps if s.get("step") == FLOOR), None)
    start, end = errors["before"], errors["after"]
    if floor is None or start is None or end is None or start <= floor:
        return []
    share = (start - end) / (start - floor)
    return [
        f"Sensor noise alone gives {percent(floor)}: {percent(share)} of what could be gained has been gained."
    ]


def _channel_words(view: View) -> list[str]:
    falls = {}
    for channel in common.CHANNELS:
        pair = []
        for stage in ("before", "after"):
            rollout = _stage(view, stage, "rollout")
            entry = (rollout.get(common.main_horizon(rollout) or "") or {}).get(channel) or {}
            pair.append(finite(entry.get("nrmse")))
        if pair[0] is not None and pair[1] is not None:
            falls[channel] = pair
    if not falls:
        return []
    best = max(falls, key=lambda c: falls[c][0] - falls[c][1])
    worse = [common.channel_words(c) for c, (a, b) in falls.items() if b > 1.05 * a]
    out = [
        f"Most is gained in {common.channel_words(best)}, from {percent(falls[best][0])} to "
        f"{percent(falls[best][1])}."
    ]
    if worse:
        out.append(f"It has become worse in {listing(worse)}.")
    return out


def _runs(entry: Mapping[str, Any], whole: bool) -> Figure:
    for name in ("measured", "before", "after"):
        if entry.get(name) is None:
            raise NoData(f"the answer holds no '{name}' over time")
    title = f"held-out {common.run_words(entry, whole)}"
    series = entry["t"], entry["measured"], entry["before"], entry["after"], entry.get("refitted")
    return before_after(*series, title=title)


def _errors(entry: Mapping[str, Any]) -> Figure:
    order = ("refitted", "before", "after")
    models = {STAGES[stage]: entry[stage] for stage in order if entry.get(stage) is not None}
    title = f"held-out {common.run_words(entry, whole=False)}"
    return error_over_time(entry["t"], entry["measured"], models, title=title, limit=1000)


def _series_caption(entry: Mapping[str, Any]) -> str:
    before = common.relative_errors(entry["measured"], entry["before"])
    after = common.relative_errors(entry["measured"], entry["after"])
    words = (
        f"Held-out {common.run_words(entry, whole=False)}, the stretch in which the model as given errs "
        "most; free-running windows of 5 s, restarted from the measured state. Each panel gives its rms "
        "error before and after."
    )
    fall = before - after
    if np.isfinite(fall).any():
        i = int(np.nanargmax(fall))
        words += (
            f" Look at {style.MOTIONS[i]}: {percent(before[i])} of its spread before, {percent(after[i])} "
            "after."
        )
    return words


def _waterfall_caption(steps: list[Mapping[str, Any]]) -> str:
    known = [(str(s.get("step") or "–"), e) for s in steps if (e := finite(s.get("error"))) is not None]
    falls = [(a[1] - b[1], b[0]) for a, b in itertools.pairwise(known) if b[0] != FLOOR]
    words = (
        "Error on held-out data after each step (5 s free running, 1 is the spread of the motion); hatched: "
        "what the step took off."
    )
    if falls and max(falls)[0] > 0:
        step = max(falls)[1]
        named = "refitting the coefficients" if step == "coefficients refitted" else step
        words += f" The largest step is {named}. Below the dashed line there is only sensor noise."
    return words


def _horizons(view: View) -> Figure:
    rollouts = {name: _stage(view, stage, "rollout") for stage, name in STAGES.items()}
    models = {name: common.over_horizons(rollout) for name, rollout in rollouts.items() if rollout}
    return error_against_horizon(
        models,
        common.over_horizons(rollouts["as given"], "persistence"),
        common.over_horizons(rollouts["after"], "noise_floor"),
    )


def _stage_table(view: View, part: str, title: str, key: str) -> HtmlTable:
    rows, horizon = [], None
    for stage, name in STAGES.items():
        found = _stage(view, stage, part)
        if part == "rollout":
            horizon = common.main_horizon(found) or horizon
            found = found.get(horizon or "") or {}
            cells = [(found.get(c) or {}).get(key) for c in common.CHANNELS] + [found.get("total")]
        else:
            cells = [(found.get(f"d{c}") or {}).get(key) for c in common.CHANNELS]
        if any(finite(c) is not None for c in cells):
            rows.append([name, *(number(c) for c in cells)])
    title = title.format(common.horizon_words(horizon)) if horizon else title.replace(" over {}", "")
    return HtmlTable(title, ["model", *common.CHANNELS, *(["total"] if part == "rollout" else [])], rows)


PAGE = ImprovementPage()
