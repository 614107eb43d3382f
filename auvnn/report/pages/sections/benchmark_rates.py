"""What the page of `benchmark` says about rates and targets: part by part, and effect by effect."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from auvnn.report.html import HtmlTable
from auvnn.report.pages.sections import outcomes
from auvnn.report.pages.sections.outcomes import Row, text
from auvnn.report.view import View
from auvnn.report.words import count, finite, number, percent, plural

# What the rates are called where a reader sees them.
WORDS = {
    "named_first": "named first",
    "named_alone": "named, and no other",
    "named_or_in_group": "named first or in a declared group",
    "named_or_tied": "named first or in a group that the log cannot separate",
    "named_or_tied_at_2": "the same, groups within 2 standard errors only",
    "all_named": "several hidden, all named",
    "all_shown_named": "several hidden, all named that the log can show",
    "several_named_alone": "several hidden, all named and no other",
    "adequate_with_nothing": "nothing hidden, answered adequate",
    "unknown_with_stranger": "outside the catalogue, answered unknown",
    "axis_of_stranger": "outside the catalogue, right degree of freedom",
    "false_names": "wrong names among those given",
    "false_discovery_rate": "false discovery rate, mean over logs",
    "coverage_95": "95 % intervals that hold the true value",
    "exact_ties": "another effect fits the log equally well",
    "unseen": "hidden effect within the coefficients' stated uncertainty",
    "median_fall": "median fall of the held-out error, relative to the true model's",
    "not_made": "logs that could not be made",
    "faults": "faults, including logs that could not be made",
    "visible": "hidden effect visible to an oracle",
    "visible_named_or_tied": "visible effect named first or in a group that no oracle can separate",
    "visible_named_alone": "visible effect named first, alone in its step",
    "wrong_first": "first name wrong",
    "adequate_in_world": "nothing hidden, answered adequate (effects of the world itself aside)",
    "no_name_in_world": "nothing hidden, no wrong name",
    "left_force": "nothing hidden, unexplained force of the right size and correlation time",
    "false_discovery_in_world": "false discovery rate, mean over logs (effects of the world itself aside)",
}
# So many missed targets are named in the summary; all of them stand in the table.
MOST_MISSED = 3


def p_values_of(view: View) -> dict[str, list[float]]:
    """Return effect to the p-values of its test where nothing is hidden."""
    out = {}
    for effect, found in view.mapping("uniformity").items():
        values = found.get("p_values") if isinstance(found, Mapping) else None
        if isinstance(values, (list, tuple)):
            out[str(effect)] = [p for value in values if (p := finite(value)) is not None]
    return {effect: values for effect, values in out.items() if values}


def target_words(view: View) -> list[str]:
    """Return how many targets are met, and which are not."""
    aims = [a for a in view.items("targets") if isinstance(a, Mapping) and isinstance(a.get("met"), bool)]
    if not aims:
        return []
    missed = [a for a in aims if not a["met"]]
    words = f"{count(len(aims) - len(missed))} of {plural(len(aims), 'target')} are met"
    if missed:
        which = [
            f"“{text(a, 'part')}”, {_name(a)}: {percent(a.get('share'))} (wanted {_wanted(a)})"
            for a in missed[:MOST_MISSED]
        ]
        more = len(missed) - len(which)
        words += f". Missed in {'; '.join(which)}" + (f"; and {plural(more, 'other')}" if more else "")
    return [f"{words}."]


def other_words(rows: Sequence[Row]) -> list[str]:
    """Return what became of logs that hide several effects, or something outside the catalogue."""
    out = []
    several = outcomes.of_kind(rows, "several")
    if several:
        found = sum(map(outcomes.right, several))
        out.append(
            f"Of {plural(len(several), 'log')} that hide several effects, {count(found)} got all names and no other."
        )
    strange = outcomes.of_kind(rows, "stranger")
    if strange:
        found = sum(map(outcomes.right, strange))
        out.append(
            f"Of {plural(len(strange), 'log')} that hide something outside the catalogue, {count(found)} were "
            "answered unknown."
        )
    return out


def rate_tables(view: View) -> list[HtmlTable]:
    """Return targets, rates by part, and rates by effect."""
    return [
        HtmlTable("Targets", *_target_rows(view), words=2, folded=False),
        HtmlTable(
            "Rates by part",
            *_rate_rows(view),
            "Intervals: Wilson's for shares and for means of shares; of a median by its order statistics. What is "
            "counted: logs, names or parameters.",
            words=2,
        ),
        HtmlTable(
            "By effect",
            *_effect_rows(view),
            "Single effects. Or tied: in a declared group whose other members cannot be told from it on that log. "
            "Found in 90 %: the size at which nine in ten are named or tied, in standard errors of a fit that "
            "knows everything else (of coefficients: in stated uncertainties), by a logistic curve; where it is not "
            "determined, why.",
            folded=False,
        ),
    ]


def _name(entry: Mapping[str, Any]) -> str:
    return WORDS.get(text(entry, "rate"), text(entry, "rate"))


def _wanted(aim: Mapping[str, Any]) -> str:
    least, most = finite(aim.get("least")), finite(aim.get("most"))
    if least is not None and most is not None:
        return f"{percent(least)} to {percent(most)}"
    return f"at least {percent(least)}" if least is not None else f"at most {percent(most)}"


def _interval(entry: Mapping[str, Any]) -> str:
    low, high = finite(entry.get("low")), finite(entry.get("high"))
    if low is None or high is None:
        return "–"
    return f"{100 * low:.1f} to {100 * high:.1f}\N{NO-BREAK SPACE}%"


def _share(entry: Mapping[str, Any]) -> str:
    share = finite(entry.get("share"))
    return "–" if share is None else f"{100 * share:.1f}\N{NO-BREAK SPACE}%"


def _target_rows(view: View) -> tuple[list[str], list[list[str]]]:
    out = []
    for aim in view.items("targets"):
        if isinstance(aim, Mapping):
            met = {True: "met", False: "missed"}.get(aim.get("met"), "not measured")  # type: ignore[arg-type]
            out.append([
                text(aim, "part"), _name(aim), _wanted(aim), _share(aim), _interval(aim), count(aim.get("count")), met,
            ])  # fmt: skip
    return ["part", "rate", "wanted", "found", "95 % interval", "of", "verdict"], out


def _rate_rows(view: View) -> tuple[list[str], list[list[str]]]:
    out = [
        [text(r, "part"), _name(r), count(r.get("hits")), count(r.get("count")), _share(r), _interval(r)]
        for r in view.items("rates")
        if isinstance(r, Mapping)
    ]
    return ["part", "rate", "hits", "of", "share", "95 % interval"], out


def _effect_rows(view: View) -> tuple[list[str], list[list[str]]]:
    out = []
    for entry in view.items("effects"):
        if not isinstance(entry, Mapping):
            continue
        rates = [entry.get(k) for k in ("named_first", "named_alone", "named_or_in_group", "named_or_tied")]
        shares = [percent(r.get("share")) if isinstance(r, Mapping) else "–" for r in rates]
        last = rates[-1]
        inside = entry.get("intervals")
        inside = inside if isinstance(inside, Mapping) else {}
        out.append([
            text(entry, "effect"), count(entry.get("logs")), *shares,
            _interval(last) if isinstance(last, Mapping) else "–", _smallest(entry.get("size_90")),
            f"{count(inside.get('hits'))} of {count(inside.get('count'))}", percent(entry.get("exact_ties")),
            percent(entry.get("median_fall")), count(entry.get("faults")),
        ])  # fmt: skip
    head = ["effect", "logs", "named first", "alone", "or in a group", "or tied", "95 % interval", "found in 90 %",
            "intervals right", "exact ties", "fall, median", "faults"]  # fmt: skip
    return head, out


def _smallest(found: Any) -> str:
    if not isinstance(found, Mapping):
        return "–"
    size, low, high = (finite(found.get(k)) for k in ("size", "low", "high"))
    if found.get("determined") is True and None not in (size, low, high):
        return f"{number(size, 2)} ({number(low, 2)} to {number(high, 2)})"
    return text(found, "words", "–")
