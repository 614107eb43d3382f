"""Sentences, columns and small tables of the page of `diagnose`."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report.html import HtmlTable
from auvnn.report.page import Plot
from auvnn.report.pages import common
from auvnn.report.panels import NoData
from auvnn.report.plots.parameters import parameters
from auvnn.report.plots.ranking import brackets, improvement
from auvnn.report.plots.residual_tests import residual_tests
from auvnn.report.plots.similarity import similarity
from auvnn.report.view import View
from auvnn.report.words import count, finite, listing, number, p_value, percent, plural

# Effects in the figure of similarities at most, and how like the named ones the others there must be.
MOST_ALIKE, LEAST_ALIKE = 14, 0.4


def _candidates(view: View) -> list[Mapping[str, Any]]:
    return [c for c in view.items("candidates") if isinstance(c, Mapping)]


def _channels(view: View) -> list[str]:
    rows = [s for s in view.mapping("depends_on").values() if isinstance(s, Mapping)]
    return list(dict.fromkeys(str(name) for row in rows for name in row))


def _whole_log(view: View) -> list[HtmlTable]:
    """Return what all of a long log says, compared with the sample on which the search ran."""
    whole = view.mapping("whole_log")
    if not whole:
        return []
    fitted = {**(whole.get("parameters") or {}), **(whole.get("coefficients") or {})}
    rows = [
        [
            str(c.get("effect")),
            p_value(c.get("p_value")),
            number(c.get("evidence"), 4),
            number(c.get("inflation")),
        ]
        for c in whole.get("candidates") or []
    ]
    words = str((whole.get("searched") or {}).get("words", ""))
    caption = (
        f"{words[:1].upper()}{words[1:]}. Here the leading effects are tested at the null on "
        f"{count(whole.get('looked_at'))} of {count(whole.get('windows'))} windows ({count(whole.get('samples'))} "
        f"samples in {plural(whole.get('files'), 'file')}). Evidence: natural logarithm of the Bayes factor; inflation: "
        "by how much the scores vary more than white noise would."
    )
    left = "what is left is white" if whole.get("adequate") else "what is left is slower than white noise"
    return [
        HtmlTable("On all of the log: tests", ["effect", "p", "evidence", "inflation"], rows, caption),
        HtmlTable(
            "On all of the log: values",
            common.PARAMETER_HEAD,
            common.parameter_rows(fitted),
            f"What was found, with the uncertain coefficients, fitted to the same windows; {left}.",
            words=2,
        ),
    ]


def _first_sentence(verdict: str, missing: list[str], stated: Container[str] = ()) -> str:
    several = len(missing) > 1
    other = [n for n in missing if n in stated]
    if other and verdict == "named":
        rest = [n for n in missing if n not in stated]
        lacks = [f"lacks {listing(rest)}"] if rest else []
        return f"The model {' and '.join([*lacks, f'has {listing(other)} at other values than the log'])}."
    return {
        "named": f"The model lacks {listing(missing)}.",
        "ambiguous": f"The model lacks something, and this log cannot tell which: {listing(missing, 'or')}.",
        "partial": "The model lacks something that no effect of the catalogue explains as a whole.",
        "unknown": "The model lacks something that nothing in the catalogue explains.",
        "adequate": "Nothing is missing that this log could show: what the model does not explain looks "
        "like noise.",
    }.get(verdict, f"The verdict is '{verdict}'" + (f": {listing(missing)}" if several else "") + ".")


def _further(view: View, missing: list[str]) -> list[str]:
    """Return what was named in addition to an ambiguous group, and not withdrawn again."""
    if view.text("verdict") != "ambiguous":
        return []
    steps = view.items("steps")
    gone = {e for s in steps if s.get("verdict") == "withdrawn" for e in View(s).texts("effects")}
    named = [e for s in steps if s.get("verdict") == "named" for e in View(s).texts("effects")]
    return [e for e in named if e not in gone and e not in missing]


def _candidate_words(candidate: Mapping[str, Any]) -> str:
    words = f"{candidate.get('effect')}"
    if candidate.get("parameters"):
        words += f" ({common.parameter_words(candidate['parameters'])})"
    words += f" explains {percent(candidate.get('explained'))} of the residual above the noise"
    fall, _ = improvement(candidate)
    if fall is not None:
        direction = "lowers" if fall > 0 else "raises"
        words += f" and {direction} the error over windows left out, noise included, by {percent(abs(fall))}"
    return f"{words}; p = {p_value(candidate.get('p_value'))}.".replace("p = <", "p <")


def _rival_words(candidates: list[Mapping[str, Any]], missing: list[str]) -> list[str]:
    lead = next((c for c in candidates if str(c.get("effect")) in missing), None)
    if lead is None:
        return []
    alike = [
        str(o.get("effect")) for o in lead.get("confusable_with") or [] if str(o.get("effect")) not in missing
    ]
    out = [f"On this log it is hard to tell from {listing(alike)}."] if alike else []
    rest = [c for c in candidates if str(c.get("effect")) not in missing and not c.get("needs")]
    if rest and not alike:
        out.append(
            f"The next candidate, {rest[0].get('effect')}, explains {percent(rest[0].get('explained'))}."
        )
    return out


def _best_of_the_rest(candidates: list[Mapping[str, Any]]) -> list[str]:
    tried = [c for c in candidates if not c.get("needs")]
    if not tried:
        return ["No effect of the catalogue could be judged on this log."]
    best = tried[0]
    share, p = percent(best.get("explained")), p_value(best.get("p_value"))
    return [
        f"{plural(len(tried), 'effect')} of the catalogue {'was' if len(tried) == 1 else 'were'} tried; the "
        f"best, {best.get('effect')}, would explain {share} of the residual above the noise (p = {p})."
    ]


def _force_words(view: View) -> list[str]:
    """Say where the force without a name acts, and which names come nearest."""
    out = []
    nearest, axes = view.texts("nearest"), list(view.mapping("acts_in"))
    if nearest and view.text("verdict") != "partial":
        one = len(nearest) == 1
        out.append(
            f"{listing(nearest)} {'comes' if one else 'come'} nearest, and {'leaves' if one else 'leave'} too much of "
            "it to be the cause."
        )
    if axes:
        also = f", and shows in {listing(axes[1:])} too" if axes[1:] else ""
        out.append(f"What is left acts as a force in {axes[0]}{also}.")
    return out


def _alone_words(candidates: list[Mapping[str, Any]], nearest: list[str]) -> str:
    """Say why what comes nearest is not what explains most alone, where these differ."""
    tried = [c for c in candidates if not c.get("needs") and finite(c.get("explained")) is not None]
    best = max(tried, key=lambda c: finite(c.get("explained")) or 0.0, default=None)
    if best is None or str(best.get("effect")) in nearest:
        return ""
    return (
        f" Alone, {best.get('effect')} explains more ({percent(best.get('explained'))}); but shares of single effects "
        "overlap, and the search, which weighs fit against the number of parameters, chose those in italics."
    )


def _dependence_words(view: View) -> list[str]:
    shares = [
        (share, axis, channel)
        for axis, row in view.mapping("depends_on").items()
        if isinstance(row, Mapping)
        for channel, value in row.items()
        if (share := finite(value)) is not None
    ]
    if not shares:
        return []
    share, axis, channel = max(shares)
    groups = view.mapping("inseparable").get(axis)
    alike = [
        str(name)
        for group in (groups if isinstance(groups, list) else [])
        if isinstance(group, list) and channel in group
        for name in group
        if name != channel
    ]
    also = f" This log cannot tell it from {listing(alike, last='or')}." if alike else ""
    return [
        f"What remains depends most on {channel}, which explains {percent(share)} of the residual in {axis}.{also}"
    ]


def _ranking_caption(
    candidates: list[Mapping[str, Any]], missing: list[str], nearest: list[str] | None = None
) -> str:
    words = (
        "Left: share of the residual's energy above the noise that each effect explains. Right: how far the "
        "error falls on runs that were not fitted; left of zero the effect harms."
    )
    if missing:
        words += (
            " Hatched and bold, and first: what the verdict names; the others by what each explains alone."
        )
    elif nearest:
        words += " In italics, and first: what comes nearest; the others by what each explains alone."
        words += _alone_words(candidates, nearest)
    else:
        words += " Ordered by what each explains alone."
    if any(
        (finite(c.get("explained")) or 0.0) > 0.3 and (improvement(c)[0] or 0.0) < 0.05 for c in candidates
    ):
        words += " A long bar with a point near zero fits the runs that it was fitted to and does not predict the others."
    if brackets(candidates, missing):
        words += " Brackets join what this log can hardly tell apart."
    return words


def _parameters(chosen: Mapping[str, Any]) -> Figure:
    if not chosen:
        raise NoData("the verdict names no effect")
    return parameters(chosen)


def _similarity(view: View) -> Figure:
    found = view.get("similarity")
    if not isinstance(found, (list, tuple)) or len(found) != 2:
        raise NoData("the answer holds no similarities")
    names, table = [str(n) for n in found[0]], np.abs(np.asarray(found[1], dtype=float))
    if table.shape != (len(names), len(names)):
        raise NoData("the answer holds no similarities")
    kept = in_question(names, table, [*view.texts("missing"), *view.texts("nearest")], _candidates(view))
    return similarity([names[k] for k in kept], table[np.ix_(kept, kept)])


def in_question(
    names: list[str], table: np.ndarray, named: list[str], candidates: list[Mapping[str, Any]]
) -> list[int]:
    """Return which effects a person would confuse: those named, the leading candidates, and what is like them.

    Args:
        names: of all effects, n.
        table: (n, n) similarities, 0 to 1.
        named: by the verdict.
        candidates: best first.
    """
    if len(names) <= MOST_ALIKE:
        return list(range(len(names)))
    leading = [str(c.get("effect")) for c in candidates if not c.get("needs")]
    first = [n for n in dict.fromkeys([*named, *leading[:4]]) if n in names]
    kept = [names.index(n) for n in first[: MOST_ALIKE // 2]] or [0]
    alike = np.nan_to_num(table[kept].max(axis=0))
    for k in np.argsort(-alike, kind="stable"):
        if len(kept) >= MOST_ALIKE or alike[k] < LEAST_ALIKE:
            break
        if int(k) not in kept:
            kept.append(int(k))
    for name in leading:
        if len(kept) >= max(6, len(first)):
            break
        if name in names and names.index(name) not in kept:
            kept.append(names.index(name))
    return kept


def _whiteness(view: View) -> list[Plot]:
    if not view.mapping("residual_tests"):
        return []
    return [
        Plot(
            "residual_tests",
            "Whiteness of what is left",
            lambda: _residual_tests(view),
            "Autocorrelation of what free running leaves, initial states estimated. Grey: where white noise of the "
            "sensors would lie, 99 % of it, after the same estimation. What leaves the band is not noise.",
        )
    ]


def _residual_tests(view: View) -> Figure:
    found = view.mapping("residual_tests")
    before, after = found.get("before"), found.get("after")
    if not (isinstance(before, Mapping) and isinstance(after, Mapping)):
        raise NoData("the answer holds no residual tests")
    return residual_tests(before, after)


def _with_commands(tested: Mapping[str, Any]) -> list[list[str]]:
    rows = []
    for name, by_axis in (tested.get("with_commands") or {}).items():
        for axis, entry in by_axis.items():
            bands = finite(entry.get("bands"))
            if bands is not None and bands > 1:
                cells = [number(entry.get(k), 2) for k in ("largest", "lag", "bands")]
                rows.append([str(name), str(axis), *cells])
    return rows


def _parameter_columns(fitted: Mapping[str, Any]) -> tuple[list[str], list[list[str]]]:
    table = common.parameter_table(fitted)
    return table.head, table.rows
