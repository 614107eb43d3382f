"""The page of `compare` with several models: one figure, one table, then each model's own page folded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.pages import common
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.view import View
from auvnn.report.words import finite, number, percent


class ComparisonsPage(Page):
    """What a comparison of several models says."""

    kind = "comparisons"

    def title(self, view: View) -> str:
        """Return the heading."""
        return "Models against measurements"

    def about(self, view: View) -> str:
        """Return models and log."""
        return f"{', '.join(view.texts('models'))} against {view.text('log', 'a log')}"

    def brief(self, view: View) -> list[str]:
        """Return which predicts best, and whether that is better than no model."""
        key, ranking, found = view.get("horizon"), view.texts("ranking"), _answers(view)
        if key is None or not ranking:
            return ["No stretch of the log was long enough, or moved enough, to let every model run free."]
        error = {label: common.total(found[label]["rollout"], key) for label in ranking}
        best, last = ranking[0], ranking[-1]
        words = (
            f"Running free for {common.horizon_words(key)}, {best} errs least: by {percent(error[best])} of"
        )
        out = [f"{words} the spread of the motion; {last} errs most, by {percent(error[last])}."]
        held = common.total(found[best]["rollout"], key, "persistence")
        worse = [n for n in ranking if held is not None and (e := error[n]) is not None and e > held]
        if worse:
            out.append(
                f"Worse than simply holding the initial velocity ({percent(held)}): {', '.join(worse)}."
            )
        floor = common.total(found[best]["rollout"], key, "noise_floor")
        if floor is not None:
            out.append(f"Noise alone would leave {percent(floor)}.")
        return out

    def plots(self, view: View) -> list[Plot]:
        """Return the errors of all models over the horizon."""
        return [
            Plot(
                "error_against_horizon",
                "Error against horizon",
                lambda: _horizons(view),
                "Error of free running, averaged over the channels that move, against how long the models run free; "
                "dotted, what holding the initial velocity gives, and in grey what noise alone would leave.",
            )
        ]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the models side by side: free running, one step ahead, and where each errs most."""
        found, out = _answers(view), []
        horizons = list(next(iter(found.values()))["rollout"]) if found else []
        ranking = view.texts("ranking")
        rows = [
            [label, *(number(common.total(found[label]["rollout"], h)) for h in horizons)]
            for label in ranking
        ]
        head = ["model", *map(common.horizon_words, horizons)]
        out.append(HtmlTable("Free-running error by horizon", head, rows, "Best first.", folded=False))
        key = view.get("horizon")
        if key is not None:
            rows = [
                [
                    label,
                    *(
                        number((found[label]["rollout"][key].get(c) or {}).get("nrmse"))
                        for c in common.CHANNELS
                    ),
                ]
                for label in ranking
            ]
            title = f"By channel, {common.horizon_words(key)} of free running"
            out.append(HtmlTable(title, ["model", *common.CHANNELS], rows, folded=False))
        rows = [[label, *(number(_r2(found[label], f"d{c}")) for c in common.CHANNELS)] for label in ranking]
        out.append(HtmlTable("R² of the acceleration, one step ahead", ["model", *common.CHANNELS], rows))
        return out

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read."""
        read = f"{view.get('samples', '')} samples in {view.get('runs', '')} runs"
        return [("Log", view.text("log")), ("Read", read)]


def _answers(view: View) -> Mapping[str, Any]:
    return view.data.get("comparisons") or {}


def _r2(answer: Mapping[str, Any], name: str) -> float | None:
    return finite((answer.get("one_step", {}).get(name) or {}).get("r2"))


def _horizons(view: View) -> Figure:
    found = _answers(view)
    rollouts = {label: found[label]["rollout"] for label in view.texts("models") if label in found}
    best = rollouts[next(iter(view.texts("ranking")))]
    return error_against_horizon(
        {label: common.over_horizons(rollout) for label, rollout in rollouts.items()},
        common.over_horizons(best, "persistence"),
        common.over_horizons(best, "noise_floor"),
    )


PAGE = ComparisonsPage()
