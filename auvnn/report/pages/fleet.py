"""The page of `fleet`: the values of each dive, and whether they are the same on all."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.plots.over_dives import MOST, over_dives
from auvnn.report.view import View
from auvnn.report.words import count, finite, interval, listing, number, p_value, plural


class FleetPage(Page):
    """What effects do over dives."""

    kind = "fleet"

    def title(self, view: View) -> str:
        """Return what was found as heading."""
        changing = [t for t in _trends(view) if t.get("changes")]
        if not changing:
            return f"{listing(view.texts('effects'))}: the same on all dives"
        names = [f"{t.get('effect')}.{t.get('parameter')}" for t in changing[:4]]
        more = len(changing) - len(names)
        return f"Not the same on all dives: {listing([*names, *([f'{more} more'] if more else [])])}"

    def about(self, view: View) -> str:
        """Return model and dives."""
        return f"{view.text('model', 'a model')} on {plural(len(view.items('dives')), 'dive')}"

    def brief(self, view: View) -> list[str]:
        """Return the answer in plain words, what changes first."""
        rows = _trends(view)
        changing = [t for t in rows if t.get("changes")]
        out = [f"{str(t.get('words', '')).rstrip('.')}." for t in changing[:3]]
        if more := [_named(t) for t in changing[3:]]:
            out.append(f"Not the same on all dives either: {listing(more)}.")
        few = [t for t in rows if (finite(t.get("dives")) or 2) < 2]
        same = [t for t in rows if not t.get("changes") and t not in few]
        if same:
            # Every parameter is named: what is left out of a summary is read as not having been asked.
            told = ", ".join(f"{_named(t)} {_mean(t)}" for t in same)
            out.append(f"The same on all dives within their uncertainties: {told}.")
        if few:
            out.append(f"Too few dives say something of {listing([_named(t) for t in few])}.")
        failed = view.items("failed")
        if failed:
            out.append(f"{plural(len(failed), 'dive')} could not be fitted.")
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the figure."""
        dives, rows = view.items("dives"), _trends(view)
        more = f" The first {MOST} of {len(rows)} parameters." if len(rows) > MOST else ""
        since = str(dives[0].get("start") or "") if dives else ""
        return [
            Plot(
                "over_dives",
                "Parameters over the dives",
                lambda: over_dives(dives, rows, view.text("along"), since),
                "Each dive fitted separately. Hollow: something is left that these effects do not explain, and the value "
                f"may stand in for it.{more}",
            )
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        rows = []
        for t in _trends(view):
            slope, constancy = t.get("slope") or {}, t.get("constancy") or {}
            mean = t.get("mean") or {}
            rows.append([
                str(t.get("effect")), str(t.get("parameter")), "yes" if t.get("changes") else "no",
                interval(mean.get("value"), mean.get("std"), str(t.get("unit") or "")),
                f"{number(constancy.get('chi2'), 4)} on {count(constancy.get('degrees'))}",
                p_value(constancy.get("p_value")),
                interval(slope.get("value"), slope.get("std"), str(slope.get("unit") or "")),
                p_value(slope.get("p_value")),
            ])  # fmt: skip
        head = ["effect", "parameter", "changes", "mean", "chi² of constancy", "p", "slope", "p of slope"]
        values, names = [], []
        for dive in view.items("dives"):
            fitted = dive.get("parameters") or {}
            # In the order in which they were asked for.
            order = [*(e for e in view.texts("effects") if e in fitted), *fitted]
            for effect in dict.fromkeys(order):
                for name, entry in fitted[effect].items():
                    value = interval(entry.get("value"), entry.get("std"), str(entry.get("unit") or ""))
                    values.append(
                        [str(dive.get("dive")), _start(dive), effect, name, value, str(dive.get("verdict"))]
                    )
            names.append([
                str(dive.get("dive")), _file(dive), _start(dive), str(dive.get("verdict")),
                count(dive.get("samples")), count(dive.get("windows")), number(finite(dive.get("cv"))),
            ])  # fmt: skip
        failed = [[_file(f), str(f.get("words"))] for f in view.items("failed") if isinstance(f, Mapping)]
        return [
            HtmlTable("Does it change?", head, rows, "Mean and slope ± one standard deviation; p of each test alone, "
                  "and “changes” where one of them holds among all parameters (5 %, Bonferroni).", words=3),
            HtmlTable("Values of each dive", ["dive", "start", "effect", "parameter", "value", "verdict"], values,
                  words=4),
            HtmlTable("Dives", ["dive", "file", "start", "verdict", "samples", "windows", "cv error"], names,
                  "Adequate: what is left is white. cv error: on stretches left out, in standard deviations of the "
                  "error; 1 is noise alone.", words=4),
            HtmlTable("Dives that could not be fitted", ["file", "why"], failed, words=2),
        ]  # fmt: skip

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed."""
        order = "by date" if view.text("along") == "date" else "by name"
        return [
            ("Model", view.text("model")),
            ("Effects", listing(view.texts("effects"))),
            ("Order of dives", order),
        ]


def _trends(view: View) -> list[Mapping[str, Any]]:
    return [t for t in view.items("trends") if isinstance(t, Mapping)]


def _named(trend: Mapping[str, Any]) -> str:
    return f"{trend.get('effect')}.{trend.get('parameter')}"


def _mean(trend: Mapping[str, Any]) -> str:
    mean = trend.get("mean") or {}
    return interval(mean.get("value"), mean.get("std"), str(trend.get("unit") or ""))


def _file(dive: Mapping[str, Any]) -> str:
    """Return the name of a dive's file; where it lies stands in the JSON answer."""
    return str(dive.get("file") or "–").replace("\\", "/").rstrip("/").rpartition("/")[2]


def _start(dive: Mapping[str, Any]) -> str:
    # A date without a time stands as midnight.
    return str(dive.get("start") or "–").replace("T", " ").removesuffix("+00:00").removesuffix(" 00:00:00")


PAGE = FleetPage()
