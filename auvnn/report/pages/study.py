"""The page of `study`: the paper's figures in their order, and the numbers beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from auvnn.report.html import HtmlTable
from auvnn.report.page import Page, Plot
from auvnn.report.panels import NoData
from auvnn.report.plots.damping_curves import damping_curves
from auvnn.report.plots.free_running import free_running
from auvnn.report.plots.frozen_ahead import frozen_ahead
from auvnn.report.plots.structures import structures
from auvnn.report.view import View
from auvnn.report.words import count, finite, number, percent

TITLES = {
    "noise_free": "Case study I: drag from noise-free signals",
    "noisy": "Case study II: drag under noisy conditions",
    "payload": "Case study III: a payload is picked up",
}
HELD_OUT = {
    "multisine_rmse_over_range_worst": "held out: a fresh multisine",
    "manoeuvre_rmse_over_range_worst": "the paper's manoeuvre",
}


RANGE = "rmse_over_range_worst"
# Columns that a page has room for.
WIDE = 8


class StudyPage(Page):
    """What a case study says."""

    kind = "study"
    shown = 12  # the paper's figures are the story

    def title(self, view: View) -> str:
        """Return the heading."""
        case = view.text("case")
        return TITLES.get(case, f"Case study: {case}")

    def about(self, view: View) -> str:
        """Return vehicle and seed."""
        return f"{view.text('name', 'a vehicle')}, seed {view.mapping('options').get('seed')}"

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words."""
        metrics = {k: finite(v) for k, v in view.mapping("metrics").items()}
        words = {"noise_free": _noise_free, "noisy": _noisy, "payload": _payload}.get(view.text("case"))
        return [] if words is None else words(metrics)

    def warnings(self, view: View) -> list[str]:
        """Return what a reader must keep in mind."""
        smoke = view.mapping("options").get("effort") == "smoke"
        return [*(["A smoke run: everything is cut down, its numbers mean nothing."] if smoke else []),
                *view.texts("warnings")]  # fmt: skip

    def plots(self, view: View) -> list[Plot]:
        """Return the figures, in the paper's order and then ours."""
        return [_plot(found) for found in view.items("drawn")]

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the comparison, and all metrics."""
        rows = view.items("table")
        head = list(rows[0]) if rows else []
        # Leading columns that hold words stand to the left.
        words = next(
            (k for k, key in enumerate(head) if any(not isinstance(r.get(key), str) for r in rows)), 1
        )
        cells = [
            [_share(row.get(key)) if key.endswith(RANGE) else _cell(row.get(key)) for key in head]
            for row in rows
        ]
        metrics = [[str(k), _cell(v)] for k, v in view.mapping("metrics").items()]
        return [
            *_upright([_column(h) for h in head], cells, max(words, 1)),
            HtmlTable("Metrics, named as in study.json", ["name", "value"], metrics, folded=True),
        ]

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what the paper leaves open and was decided here, said once and then counted."""
        told = [words.partition(": ")[::2] for words in view.texts("assumed")]
        groups = {"As in the paper": [], "Not in the paper, decided here": [], "Integration": []}
        heads = {"as the paper": "As in the paper", "ours": "Not in the paper, decided here"}
        for head, rest in told:
            groups[heads.get(head, "Integration")].append(rest if head in heads else head)
        return [
            (name if k == 0 else "", f"{k + 1}. {_sentence(words)}" if len(members) > 1 else _sentence(words))
            for name, members in groups.items()
            for k, words in enumerate(members)
        ]


def _sentence(words: str) -> str:
    return words[:1].upper() + words[1:]


def _plot(found: Mapping[str, Any]) -> Plot:
    def draw() -> Figure:
        kind = found["kind"]
        marks = {k: found[k] for k in ("mark", "mark_words") if k in found}
        if kind == "velocity":
            return free_running(found["t"], found["lines"], **marks)
        if kind == "ahead":
            return frozen_ahead(found["windows"], ahead=found["ahead"], **marks)
        if kind == "damping":
            return damping_curves(found["curves"])
        if kind == "structures":
            return structures(found["rows"], HELD_OUT)
        raise NoData(f"a figure of kind {kind} is not known here")

    return Plot(found["name"], found["title"], draw, found["caption"])


def _column(key: str) -> str:
    """Return the name of a column in words: `tracking_rmse_over_range_worst` is said in full."""
    name = key.replace(RANGE, "error, worst velocity, % of its range").replace("_", " ")
    return name.removesuffix(" s") + (", s" if name.endswith(" s") else "")


def _upright(head: list[str], cells: list[list[str]], words: int) -> list[HtmlTable]:
    """Return the comparison; a table that is too wide for a page is turned, or else divided.

    Args:
        head: names of the columns.
        cells: as text.
        words: how many leading columns hold words.
    """
    if len(head) <= WIDE:
        return [HtmlTable("Compared", head, cells, folded=False, words=words)]
    if len(cells) + 1 <= WIDE:
        turned = [[name, *(row[k] for row in cells)] for k, name in enumerate(head) if k]
        return [HtmlTable("Compared", [head[0], *(row[0] for row in cells)], turned, folded=False)]
    out = []
    for k in range(1, len(head), WIDE - 1):
        part = slice(k, k + WIDE - 1)
        rows = [[row[0], *row[part]] for row in cells]
        more = "" if k == 1 else ", continued"
        out.append(HtmlTable(f"Compared{more}", [head[0], *head[part]], rows, folded=False))
    return out


def _cell(value: Any) -> str:
    if isinstance(value, int) and not isinstance(value, bool):
        return count(value)
    return value if isinstance(value, str) else number(value, 4)


def _share(value: Any) -> str:
    known = finite(value)
    return "–" if known is None else number(100.0 * known, 3)


def _noise_free(m: Mapping[str, float | None]) -> list[str]:
    out = [
        f"On the manoeuvre that they were trained on, the six networks run free for the whole run within "
        f"{percent(m.get('manoeuvre_rmse_over_range_worst'))} of the velocity's range; without damping the model is "
        f"{number(m.get('manoeuvre_zero_damping_rmse_over_range_worst'), 2)} times the range away.",
        "On a manoeuvre that they were not trained on, the same networks are "
        f"{percent(m.get('manoeuvre_trained_held_out_multisine_rmse_over_range_worst'))} of the range off: that figure 5 "
        "agrees does not show that the damping was identified.",
        "Trained on a rich manoeuvre they stay within "
        f"{percent(m.get('held_out_rmse_over_range_worst'))} on everything held out.",
    ]
    if m.get("larger_held_out_rmse_over_range_worst") is not None:
        out.append(
            f"With {count(m.get('larger_hidden_units'))} hidden units instead of 5 that becomes "
            f"{percent(m['larger_held_out_rmse_over_range_worst'])}."
        )
    if m.get("parallel_over_six_held_out_rich") is not None:
        out.append(
            "One network in parallel to the whole model, of as many weights and on the same data, has "
            f"{number(m['parallel_over_six_held_out_rich'], 2)} times their held-out error, trained on rich data, "
            f"and {number(m.get('parallel_over_six_held_out_manoeuvre'), 2)} times trained on the paper's."
        )
    return out


def _online(m: Mapping[str, float | None]) -> list[str]:
    return [k.removesuffix("_frozen_over_offline") for k in m if k.endswith("_frozen_over_offline")]


def _noisy(m: Mapping[str, float | None]) -> list[str]:
    out = [
        "Trained on noisy accelerations, the model that runs free is off by "
        f"{percent(m.get('offline_tracking_rmse_over_range_worst'))} of the velocity's range."
    ]
    for name in _online(m):
        out.append(
            f"Online learning {_way(name)}: off by {percent(m.get(f'{name}_tracking_rmse_over_range_worst'))} while the "
            f"weights change. With the weights frozen, the error is {_beside(m[f'{name}_frozen_over_offline'])} the "
            f"offline networks'; on held-out velocities the error of the damping is "
            f"{_beside(m.get(f'{name}_global_error_over_offline'))} theirs."
        )
    return out


def _way(name: str) -> str:
    """Return how an adapter learns: "follow" is the paper's, every sample; "guarded" refuses what noise could be."""
    words = {"follow": "that follows every sample, as in the paper", "guarded": "with guards against noise"}
    return words.get(name, f"({name})")


def _beside(ratio: float | None) -> str:
    """Return how an error compares with another one."""
    if ratio is None:
        return "not known against"
    if abs(ratio - 1.0) <= 0.02:
        return "the same as"
    if ratio < 1.0:
        return f"{percent(1.0 - ratio)} smaller than"
    return f"{percent(ratio - 1.0)} larger than" if ratio < 2.0 else f"{number(ratio, 2)} times"


def _payload(m: Mapping[str, float | None]) -> list[str]:
    out = [
        "Without online learning the model is off by "
        f"{percent(m.get('offline_tracking_rmse_over_range_worst'))} of the velocity's range after the pick-up."
    ]
    for name in _online(m):
        out.append(
            f"Online learning {_way(name)}: off by {percent(m.get(f'{name}_tracking_rmse_over_range_worst'))} while the "
            f"weights change. With the weights frozen, the error is {_beside(m[f'{name}_frozen_over_offline'])} the "
            "offline networks'."
        )
    return out


PAGE = StudyPage()
