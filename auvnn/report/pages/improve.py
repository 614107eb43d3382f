"""The page of `improve`: the error budget, step by step, and where the model stands at the end."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.plots.before_after import before_after
from auvnn.report.plots.budget import budget
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.plots.parameters import parameters
from auvnn.report.view import View
from auvnn.report.words import finite, listing, number, percent

KINDS = {
    "coefficients refitted": "by refitting its coefficients",
    "a cause with a name": "by causes that the diagnosis names",
    "a name that only predicts": "by names that predict and claim no cause",
    "learned": "by what was learned",
}


class ImprovePage(Page):
    """What walking the loop led to."""

    kind = "improve"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "The loop: from the model as given to an error budget"

    def about(self, view: View) -> str:
        """Return model, log and what was held out."""
        return (
            f"{view.text('model', 'a model')}, every choice made on {view.text('log', 'a log')}, judged once on "
            f"{view.text('test', 'a test log')}"
        )

    def brief(self, view: View) -> list[str]:
        """Return the answer in plain words."""
        steps = _steps(view)
        errors = [e for s in steps if s.get("kind") != "left" and (e := finite(s.get("error"))) is not None]
        out = []
        if errors:
            out.append(
                f"Running free for {common.horizon_words(str(view.get('horizon')))} on held-out data, the model errs by "
                f"{percent(errors[0])} of the spread of the motion as given, and by {percent(errors[-1])} at the end."
            )
        out += _beside(view)
        falls = _falls(steps)
        parts = [
            f"by {percent(falls[k])} of the spread {words}"
            for k, words in KINDS.items()
            if falls.get(k, 0.0) > 0
        ]
        if parts:
            out.append(f"The error fell {listing(parts)}.")
        floor = next((finite(s.get("error")) for s in steps if s.get("kind") == "left"), None)
        if floor is not None and errors:
            reached = errors[-1] <= 1.05 * floor
            left = (
                "nothing more can be gained on these data"
                if reached
                else "what lies between is not explained"
            )
            out.append(f"Sensor noise alone gives {percent(floor)}: {left}.")
        out.append(f"It ended because {view.text('stopped', 'it was done')}.")
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figures."""
        series = common.arrays(view.items("series"))
        line = view.mapping("baseline")
        held = _mapping(line.get("persistence"))
        lines = {"plain regression": line.get("total"), "velocity held": held.get("total")}

        @functools.cache
        def part() -> dict[str, Any]:
            return common.excerpt(series[common.worst_run(series, "after")], "after")

        def runs() -> Figure:
            entry = part()
            title = f"held-out {common.run_words(entry, whole=False)}"
            return before_after(
                entry["t"], entry["measured"], entry["before"], entry["after"], None, title=title
            )

        return [
            Plot(
                "budget",
                "The error budget",
                lambda: budget(_steps(view), lines),
                "Error on held-out data after each step; in brackets what the step changed. A step was accepted by what "
                "was left out of the log, not by these figures. The lines need no model: a linear regression of the "
                "acceleration, and holding the initial velocity.",
            ),
            Plot(
                "before_after",
                "As given and at the end, on a held-out run",
                runs,
                "The held-out stretch in which the model at the end errs most; free-running windows, restarted from the "
                "measured state.",
            ),
            Plot(
                "error_against_horizon",
                "Error against horizon",
                lambda: _horizons(view),
                "Error of free running on held-out data, averaged over the channels that move. Noise alone would leave a "
                "perfect model at the grey line.",
            ),
            Plot(
                "parameters",
                "What was fitted",
                lambda: parameters(_parameters(view), None),
                common.INTERVALS,
                folded=True,
            ),
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        taken = [s for s in view.data.get("steps") or [] if isinstance(s, Mapping)]
        tried = [s for s in view.data.get("tried") or [] if isinstance(s, Mapping)]
        head = ["step", "kind", "why", "before", "after", "fall", "± one standard error"]
        return [
            HtmlTable(
                "Steps taken, by what was left out of the log",
                head,
                [_row(s) for s in taken],
                f"Free running on what was left out ({view.text('folds')}). A step is taken if the error falls by "
                "more than its own standard error.",
                words=3,
                folded=False,
            ),
            _by_channel(view),
            HtmlTable("Tried and not taken", head, [_row(s) for s in tried], words=3, folded=True),
            common.parameter_table(_parameters(view)),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        return [
            ("Model", view.text("model")),
            ("Chosen and fitted on", view.text("log")),
            ("Left out in turn", view.text("folds")),
            ("Held out", view.text("held_out") or view.text("test")),
            ("Fitted by", str(view.mapping("objective").get("words") or "")),
            ("Error", "root mean square over free-running windows, divided by the spread of each channel"),
        ]


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}


def _steps(view: View) -> list[Mapping[str, Any]]:
    return [s for s in view.items("waterfall") if isinstance(s, Mapping)]


def _falls(steps: list[Mapping[str, Any]]) -> dict[str, float]:
    out: dict[str, float] = {}
    for before, after in itertools.pairwise(steps):
        a, b, kind = finite(before.get("error")), finite(after.get("error")), str(after.get("kind"))
        if a is not None and b is not None and kind in KINDS:
            out[kind] = out.get(kind, 0.0) + a - b
    return out


def _beside(view: View) -> list[str]:
    line, loses = view.mapping("baseline"), view.mapping("loses")
    held = line.get("persistence")
    if finite(line.get("total")) is None or not isinstance(held, Mapping):
        return []
    out = [
        f"A plain regression of the acceleration errs by {percent(line['total'])}, holding the initial velocity by "
        f"{percent(held.get('total'))}."
    ]
    out += common.losing_words(loses, "The model at the end")
    if not any(loses.get(k) for k in ("baseline", "persistence")):
        out.append("The model at the end is better than both in every channel that moves.")
    return out


def _by_channel(view: View) -> HtmlTable:
    horizon, rows = str(view.get("horizon") or "5"), []
    for name, entry in (("as given", view.mapping("before")), ("at the end", view.mapping("after"))):
        found = _mapping(entry.get(horizon))
        cells = [(found.get(c) or {}).get("nrmse") for c in common.CHANNELS]
        rows.append([name, *(number(c) for c in cells), number(found.get("total"))])
    line = view.mapping("baseline")
    for name, entry in (("plain regression", line), ("velocity held", _mapping(line.get("persistence")))):
        rows.append([name, *(number(entry.get(c)) for c in common.CHANNELS), number(entry.get("total"))])
    return HtmlTable("Held-out error by channel", ["", *common.CHANNELS, "total"], rows, folded=False)


def _row(step: Mapping[str, Any]) -> list[str]:
    gain = _mapping(step.get("gain"))
    return [
        str(step.get("step")),
        str(step.get("kind")),
        str(step.get("reason") or "–"),
        *(number(step.get(k)) for k in ("before", "after")),
        number(gain.get("value")),
        number(gain.get("std"), 2),
    ]


def _parameters(view: View) -> dict[str, Any]:
    """Return the parameters of the last step that has any: those of the model at the end."""
    for step in reversed(view.data.get("steps") or []):
        if isinstance(step, Mapping) and step.get("parameters"):
            return {str(k): v for k, v in step["parameters"].items()}
    return {}


def _horizons(view: View) -> Figure:
    models = {
        name: common.over_horizons(view.mapping(key))
        for key, name in (("before", "as given"), ("after", "after"))
    }
    after = view.mapping("after")
    return error_against_horizon(
        models, common.over_horizons(after, "persistence"), common.over_horizons(after, "noise_floor")
    )


PAGE = ImprovePage()
