"""The page of `compare`: how far off the model is, over which horizon, and where the error sits."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.pages.sections import comparison_words as say
from auvnn.report.panels import NoData
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.plots.measured_against_model import measured_against_model
from auvnn.report.plots.residual_map import relative_rms, residual_map
from auvnn.report.plots.residual_over_time import residual_over_time
from auvnn.report.view import View
from auvnn.report.words import finite, listing, number, percent, plural

WHOLE_RUNS = 4  # further runs shown whole, folded away


class ComparisonPage(Page):
    """What a comparison says, most telling first."""

    kind = "comparison"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "Model against measurements"

    def about(self, view: View) -> str:
        """Return model and log."""
        return f"{view.text('model', 'a model')} against {view.text('log', 'a log')}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        rollout, out = view.mapping("rollout"), []
        horizon = common.main_horizon(rollout)
        error, held = common.total(rollout, horizon), common.total(rollout, horizon, "persistence")
        if error is None:
            out.append("No stretch of the log was long enough, or moved enough, to let the model run free.")
        else:
            out.append(say.verdict(common.horizon_words(horizon or ""), error, held))
        out += common.baseline_words(view)
        lost = sum(int(finite(e.get("diverged")) or 0) for e in rollout.values())
        if lost:
            out.append(
                f"The model diverged in {plural(lost, 'window')}, counted with the error cut at ten standard "
                "deviations."
            )
        out += say.one_step_words(view.mapping("one_step"))
        out += say.residual_words(view.mapping("residual_wrench"))
        out += say.failure_words(view)
        if (ratio := say.largest(view.mapping("residual_wrench"))) and ratio[1] > 1.5:
            out.append(
                "Which physical effect would explain this, auvnn diagnose answers for the same model and log."
            )
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        series = common.arrays(view.items("series"))
        regimes, floor = view.mapping("regimes"), view.get("noise_floor")
        rollout = view.mapping("rollout")

        @functools.cache
        def worst() -> dict[str, Any]:
            return common.excerpt(series[common.worst_run(series, "model")], "model")

        def excerpt(draw_key: str) -> Figure:
            part = worst()
            title = common.run_words(part, whole=False)
            if draw_key == "model":
                return measured_against_model(part["t"], part["measured"], part["model"], title=title)
            if draw_key == "residual":
                return residual_over_time(part["t"], _needed(part, "residual"), floor, title=title)
            accelerations = _needed(part, "measured_acc"), _needed(part, "model_acc")
            return measured_against_model(part["t"], *accelerations, symbols=style.ACCELERATION, title=title)

        plots = [
            Plot(
                "measured_against_model",
                "Measured against model",
                lambda: excerpt("model"),
                lambda: _series_caption(worst()),
            ),
            Plot(
                "residual_map",
                "Where the residual sits",
                lambda: residual_map(regimes, floor),
                lambda: _map_caption(regimes, floor),
            ),
            Plot(
                "error_against_horizon",
                "Error against horizon",
                lambda: _horizons(rollout),
                lambda: _horizon_caption(rollout),
            ),
            Plot(
                "acceleration",
                "Acceleration, one step ahead",
                lambda: excerpt("acceleration"),
                "The same stretch of the same run: the acceleration as measured (or as estimated from the "
                "velocity), and what the model gives for the measured state and command.",
                folded=True,
            ),
            Plot(
                "residual_over_time",
                "The residual wrench over time",
                lambda: excerpt("residual"),
                "What the model lacks, as force and moment. Inside the grey band it could be sensor noise; "
                "what is smooth, or repeats with the motion, is not.",
                folded=True,
            ),
        ]
        for entry in series[:WHOLE_RUNS]:
            plots.append(_whole(entry))
        return plots

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        failures = [
            [common.channel_words(f.get("channel")), say.where(f), percent(f.get("share"))]
            for f in view.items("failures")
            if isinstance(f, Mapping)
        ]
        return [
            HtmlTable("Where the error sits", ["channel", "where", "share of the error"], failures, words=2),
            common.baseline_table(view),
            common.rollout_table(view.mapping("rollout")),
            common.one_step_table(view.mapping("one_step")),
            _wrench_table(view.mapping("residual_wrench")),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        derivative, runs = view.mapping("derivative"), view.get("runs")
        runs = len(runs) if isinstance(runs, (list, tuple)) else runs
        read = f"{plural(view.get('samples'), 'sample')} in {plural(runs, 'run')}"
        return [
            ("Model", view.text("model")),
            ("Log", view.text("log")),
            ("Read", read if finite(view.get("samples")) is not None else ""),
            ("Held out", view.text("test")),
            ("Accelerations", common.derivative_words(derivative)),
            (
                "Windows",
                "start every half horizon from the measured state; the first sample of each is not counted",
            ),
            ("Quality of the log", _quality_words(view.get("quality"))),
        ]


def _needed(entry: Mapping[str, Any], name: str) -> Any:
    if entry.get(name) is None:
        raise NoData(f"the answer holds no '{name}'")
    return entry[name]


def _series_caption(entry: Mapping[str, Any]) -> str:
    errors = common.relative_errors(entry["measured"], entry["model"])
    words = (
        f"{common.run_words(entry, whole=False).capitalize()}: the stretch in which the model errs most. It "
        "starts from the measured state every few seconds and then runs free, so the dashed line leaves the "
        "solid one between two restarts and jumps back at each."
    )
    if np.isfinite(errors).any():
        i = int(np.nanargmax(errors))
        words += (
            f" Look at {style.MOTIONS[i]}: here its error is {percent(errors[i])} of its spread, the most of "
            "the six."
        )
    return words


def _whole(entry: dict[str, Any]) -> Plot:
    name = common.run_words(entry, whole=True)
    return Plot(
        common.run_file(entry),
        f"The whole of {name}",
        lambda: measured_against_model(entry["t"], entry["measured"], entry["model"], title=name),
        common.THINNED,
        folded=True,
    )


def _horizons(rollout: Mapping[str, Any]) -> Figure:
    return error_against_horizon(
        {"as given": common.over_horizons(rollout)}, common.over_horizons(rollout, "persistence")
    )


def _horizon_caption(rollout: Mapping[str, Any]) -> str:
    better = [
        h
        for h in rollout
        if (e := common.total(rollout, h)) is not None
        and (p := common.total(rollout, h, "persistence")) is not None
        and e < p
    ]
    words = (
        "Error of free running, averaged over the channels that move, against how long the model runs free. "
    )
    if len(better) == len(rollout):
        return words + "The model beats holding the initial velocity (dotted) at every horizon."
    if not better:
        return words + "At no horizon does the model beat holding the initial velocity (dotted)."
    return words + (
        "The model beats holding the initial velocity (dotted) at "
        f"{listing(map(common.horizon_words, better))}."
    )


def _map_caption(regimes: Mapping[str, Any], floor: Any) -> str:
    best: tuple[float, str] = (0.0, "")
    good = floor is not None and np.size(floor) == 6 and bool(np.all(np.asarray(floor, dtype=float) > 0))
    for name, regime in regimes.items():
        ratio = relative_rms(regime, np.asarray(floor, dtype=float).ravel() if good else None)
        if ratio is None or not np.isfinite(ratio).any():
            continue
        i, j = np.unravel_index(int(np.nanargmax(ratio)), ratio.shape)
        edges = np.asarray(regime.get("edges", []), dtype=float).ravel()
        unit = str(regime.get("unit", "")).removeprefix("1")
        where = (
            f"{name} {number(edges[j], 2)} to {number(edges[j + 1], 2)} {unit}"
            if edges.size > j + 1
            else name
        )
        if ratio[i, j] > best[0]:
            best = (float(ratio[i, j]), f"{style.WRENCH[i][0]} at {where.strip()}")
    what = "the noise floor" if good else "the row's own rms"
    words = (
        "Each cell is the residual in one range of a regime. A row that changes from left to right depends "
        "on that regime; a row of equal numbers does not."
    )
    return f"{words} The largest: {best[1]}, {number(best[0], 2)} times {what}." if best[1] else words


def _wrench_table(residual: Mapping[str, Any]) -> HtmlTable:
    rows = [
        [
            common.channel_words(name),
            unit,
            *(number(residual[name].get(k)) for k in ("rms", "mean", "noise_floor")),
        ]
        for name, unit in style.WRENCH
        if name in residual
    ]
    caption = (
        "What the model lacks: inertia, Coriolis, damping and restoring forces of the measured motion, less "
        "the command."
    )
    return HtmlTable(
        "Residual wrench", ["axis", "unit", "rms", "mean", "noise floor"], rows, caption, words=2
    )


def _quality_words(quality: Any) -> str:
    findings = View(quality).items("findings") if quality is not None else []
    levels = [str(f.get("level")) for f in findings if isinstance(f, Mapping)]
    words = [plural(n, w) for w in ("error", "warning", "repair") if (n := levels.count(w))]
    return (listing(words) if words else "nothing to complain of") if quality is not None else ""


PAGE = ComparisonPage()
