"""The page of `adapt`: what was learned, what changed, and what was refused."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.pages.sections.adaptation_words import early_words, off_words, ratio_words, worse_words
from auvnn.report.plots.adaptation import movement, skipped, with_and_without
from auvnn.report.view import View
from auvnn.report.words import count, finite, number, percent, plural

MARKS = (
    "Grey lines part runs; dotted lines are changes that were seen, by their numbers in the table of changes."
)


class AdaptationPage(Page):
    """What an online adaptation says."""

    kind = "adaptation"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "Online adaptation"

    def about(self, view: View) -> str:
        """Return model, log and scheme."""
        scheme = view.mapping("scheme").get("scheme")
        words = f", scheme {scheme}" if scheme else ""
        return f"{view.text('model', 'a model')} on {view.text('log', 'a log')}{words}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        metrics, out = view.mapping("metrics"), []
        ratio = finite(metrics.get("frozen_5_s_error_ratio"))
        if ratio is not None:
            out.append(f"Running free for 5 s with the weights frozen at each moment, {ratio_words(ratio)}.")
        changes = _changes(view)
        out += worse_words(ratio) or early_words(changes, view.items("history"))
        out += [f"Run {change.get('run')}: {_change_words(change)}." for change in changes[:2]]
        if len(changes) > 2:
            out.append(f"{plural(len(changes) - 2, 'further change')} was seen, listed below." if len(changes) == 3
                       else f"{len(changes) - 2} further changes were seen, listed below.")  # fmt: skip
        if not changes:
            out.append("No change of the vehicle was seen.")
            out += off_words(metrics)
        learned, samples = metrics.get("samples_learned"), metrics.get("samples")
        out.append(f"{count(learned)} of {count(samples)} samples were learned from.")
        reverted = int(metrics.get("updates_reverted") or 0)
        if reverted:
            out.append(
                f"Updates were taken back {plural(reverted, 'time')} because the prediction got worse."
            )
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        return [
            Plot(
                "prediction_error",
                "Prediction error of the acceleration, with and without adaptation",
                lambda: _one_step(view),
                "Before each sample is learned from. Following every residual alone makes this small: the next "
                f"figure shows what was learned of the vehicle. {MARKS}",
            ),
            Plot(
                "frozen_error",
                "Free running for 5 s with the weights frozen at each moment",
                lambda: _frozen(view),
                "Root mean square error of the velocity over the 5 s that follow, from the measured state. There is no "
                "line where samples are missing in these 5 s.",
            ),
            Plot(
                "movement",
                "How far the weights moved",
                lambda: _movement(view),
                "Distance of all parameters from where they began, relative to their size; below, when samples were "
                "learned from.",
            ),
            Plot(
                "skipped",
                "What became of the samples",
                lambda: skipped(_counts(view)),
                "Samples learned from, and those that were not, by reason.",
            ),
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        rows, kinds = [], []
        for k, change in enumerate(_changes(view), 1):
            fitted = {str(change.get("effect")): change.get("parameters") or {}}
            first = [str(k), _time(change), str(change.get("kind"))]
            rows += [[*first, *row] for row in common.parameter_rows(fitted)]
            if not fitted[str(change.get("effect"))]:
                rows.append([*first, "–", "–", "–", "–"])
            kinds += [
                [*first[:2], str(o.get("kind")), number(o.get("evidence")), percent(o.get("explained"))]
                for o in change.get("kinds") or []
            ]
        refused = [
            [name.replace("_", " "), str(told.get("words", "")), count(told.get("count", 0))]
            for name, told in view.mapping("skipped").items()
        ]
        metrics = [[str(k), common.metric(v)] for k, v in view.mapping("metrics").items()]
        return [
            HtmlTable("Changes seen", ["number", "time, s", "kind", *common.PARAMETER_HEAD], rows, words=5),
            HtmlTable(
                "What each kind of change would explain",
                ["number", "time, s", "kind", "evidence, nats", "share explained"],
                kinds,
                "Evidence: logarithm of the odds against no change. Where several explain as much, the "
                "excitation cannot tell them apart and none is named.",
                words=3,
            ),
            HtmlTable("Samples not learned from", ["reason", "meaning", "samples"], refused, words=2),
            HtmlTable("Metrics", ["name", "value"], metrics),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        scheme = ", ".join(f"{k} {v}" for k, v in view.mapping("scheme").items())
        guards = ", ".join(f"{k} {v}" for k, v in view.mapping("guards").items())
        return [
            ("Model", view.text("model")),
            ("Log", view.text("log")),
            ("Compared", view.text("compared")),
            ("Scheme", scheme),
            ("Guards", guards),
            ("Assumed", "; ".join(view.texts("assumed"))),
        ]


def _changes(view: View) -> list[Mapping[str, Any]]:
    return [c for c in view.get("changes") or [] if isinstance(c, Mapping)]


def _change_words(change: Mapping[str, Any]) -> str:
    """Return what is said of a change; its values as they stand in tables, where it has a name."""
    fitted = change.get("parameters") or {}
    if not fitted or not change.get("effect"):
        return str(change.get("words", ""))
    values = common.parameter_words(fitted)
    return f"at {finite(change.get('time')) or 0.0:.5g} s a change of {change.get('kind')} ({change['effect']}: {values})"


def _counts(view: View) -> dict[str, int]:
    told = {name: int(v.get("count") or 0) for name, v in view.mapping("skipped").items()}
    return {"learned from": int(view.mapping("metrics").get("samples_learned") or 0), **told}


def _joined(
    view: View, key: str
) -> tuple[list[Mapping[str, Any]], dict[Any, float], list[tuple[float, str]]]:
    """Return the runs of a history, when each begins on a common clock, and the changes on that clock."""
    runs = [h for h in view.get(key) or [] if isinstance(h, Mapping) and len(h.get("t") or [])]
    whole = {h.get("run"): h for h in view.get("history") or [] if len(h.get("t") or [])}
    offsets, begin = {}, 0.0
    for name, h in whole.items():
        offsets[name] = begin - float(h["t"][0])
        begin += float(h["t"][-1]) - float(h["t"][0])
    changes = [
        (float(c["time"]) + offsets[c["run"]], str(c["kind"]))
        for c in _changes(view)
        if c.get("run") in offsets
    ]
    return runs, offsets, changes


def _table(rows: Any) -> np.ndarray:
    return np.array([[np.nan if v is None else float(v) for v in row] for row in rows], dtype=float).reshape(
        -1, 6
    )


def _drawn(view: View, key: str, adapted: str, unadapted: str, names: Any) -> Figure:
    runs, offsets, changes = _joined(view, key)
    t = [np.asarray(h["t"], dtype=float) + offsets.get(h.get("run"), 0.0) for h in runs]
    values = [np.concatenate([_table(h[n]) for h in runs]) if runs else [] for n in (adapted, unadapted)]
    return with_and_without(
        np.concatenate(t) if t else [], *values, names=names, changes=changes,
        lengths=[len(part) for part in t],
    )  # fmt: skip


def _one_step(view: View) -> Figure:
    return _drawn(view, "history", "prediction_error", "unadapted_error", style.ACCELERATION)


def _frozen(view: View) -> Figure:
    return _drawn(view, "frozen", "adapted", "unadapted", style.VELOCITY)


def _movement(view: View) -> Figure:
    runs, offsets, changes = _joined(view, "history")
    t = np.concatenate(
        [np.asarray(h["t"], dtype=float) + offsets.get(h.get("run"), 0.0) for h in runs] or [[]]
    )
    moved = np.concatenate([np.asarray(h["moved"], dtype=float) for h in runs] or [[]])
    learned = np.concatenate([np.array([c == "adapted" for c in h["cause"]]) for h in runs] or [[]])
    return movement(t, moved, learned, changes=changes)


def _time(change: Mapping[str, Any]) -> str:
    # Known to about half a second.
    time = finite(change.get("time"))
    return "–" if time is None else f"{time:.1f}"


PAGE = AdaptationPage()
