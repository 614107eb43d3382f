"""The benchmark's page in words and tables."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report.html import HtmlTable
from auvnn.report.page import Plot
from auvnn.report.pages.sections import outcomes
from auvnn.report.pages.sections.outcomes import NOTHING, Row, in_group, names, right, text, values
from auvnn.report.plots.confusion import RIGHT, confusion
from auvnn.report.plots.coverage import Z95
from auvnn.report.plots.recovery import recovery, wilson
from auvnn.report.view import View
from auvnn.report.words import count, finite, listing, number, p_value, percent, plural, prose

TARGET = 0.9


MOST_CONDITIONS = 8  # for which there is a figure each


def _confusion(rows: Sequence[Row]) -> Figure:
    right = {**RIGHT, **dict.fromkeys(outcomes.strangers(rows), "unknown")}
    return confusion(*outcomes.confusion_counts(rows), right=right)


def _recovery(rows: Sequence[Row], among: Sequence[str] = ()) -> Figure:
    return recovery(outcomes.found_by_size(rows), target=TARGET, among=among)


def _one_condition(i: int, condition: Sequence[str], rows: Sequence[Row], among: Sequence[str]) -> Plot:
    vehicle, noise, excitation = condition
    return Plot(
        f"recovery_{i}",
        f"Named first: {vehicle}, noise {noise}, manoeuvre {excitation}",
        functools.partial(_recovery, rows, among),
        f"As the figure of this kind above, from the {plural(len(rows), 'log')} of one condition alone.",
        folded=True,
    )


def _share_words(k: int, n: int) -> str:
    low, high = (100 * end for end in wilson(k, n))
    return f"{percent(k / n)}; 95\N{NO-BREAK SPACE}% interval {low:.0f} to {high:.0f}\N{NO-BREAK SPACE}%"


def _naming_words(hidden: Sequence[Row]) -> list[str]:
    if not hidden:
        return ["No log hides an effect, so this says nothing of how often one is found."]
    named, groups = sum(map(right, hidden)), sum(map(in_group, hidden))
    also = f"; in {count(groups)} more it is in a group that the log cannot tell apart" if groups else ""
    out = [
        f"In {count(named)} of {plural(len(hidden), 'log')} the hidden effect is named first "
        f"({_share_words(named, len(hidden))}){also}."
    ]
    lost = [r for r in hidden if not right(r) and not in_group(r)]
    if lost:
        name, most = Counter(text(r, "hidden") for r in lost).most_common(1)[0]
        of = sum(text(r, "hidden") == name for r in hidden)
        instead = Counter(outcomes.answer(r) for r in lost if text(r, "hidden") == name).most_common(2)
        words = listing(f"{answer} ({count(n)})" for answer, n in instead)
        out.append(f"Most often missed is {name}, {count(most)} of {count(of)} logs; answered: {words}.")
    return out


def _null_words(null: Sequence[Row]) -> str:
    if not null:
        return "Something is hidden in every log, so this says nothing of false alarms."
    found = sum(map(right, null))
    words = f"With nothing hidden, {count(found)} of {plural(len(null), 'log')}"
    return f"{words} {'is' if found == 1 else 'are'} found adequate ({_share_words(found, len(null))})."


def _wrong_words(rows: Sequence[Row], metrics: Mapping[str, Any]) -> str:
    share = finite(metrics.get("false_discovery_share"))
    given = [(text(r, "hidden"), n) for r in rows if text(r, "verdict") == "named" for n in names(r)]
    if not given:
        return "No effect is named in any log."
    if share is None:
        share = sum(name != hidden for hidden, name in given) / len(given)
    return f"Wrong names: {percent(share)} of the {count(len(given))} that were given."


def _interval_words(hidden: Sequence[Row]) -> list[str]:
    z = outcomes.errors(hidden, "z")
    if not z.size:
        return []
    worst = []
    for noise in values(hidden, "noise"):
        off = outcomes.errors([r for r in hidden if r.get("noise") == noise], "relative")
        worst += [f"{percent(off.max())} with noise {noise}"] if off.size else []
    inside = int((np.abs(z) < Z95).sum())
    words = f"For {count(inside)} of {plural(z.size, 'parameter')} ({percent(inside / z.size)})"
    sizes = f"; relative to the effect's size the largest error is {listing(worst)}" if worst else ""
    return [f"{words} the 95\N{NO-BREAK SPACE}% interval holds the true value{sizes}."]


def _condition_table(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    head = ["vehicle", "noise", "manoeuvre", "effects", "named first", "or in a group", "largest error",
            "nothing", "adequate", "faults"]  # fmt: skip
    out = []
    for condition, members in outcomes.by_condition(rows).items():
        hidden, null = outcomes.with_effect(members), outcomes.with_nothing(members)
        named, off = sum(map(right, hidden)), outcomes.errors(hidden, "relative")
        group = named + sum(map(in_group, hidden))
        found = [count(len(hidden)), _of(named, len(hidden)), _of(group, len(hidden))]
        nothing = [count(len(null)), _of(sum(map(right, null)), len(null))]
        faults = count(sum(text(r, "verdict") == "fault" for r in members))
        out.append([*condition, *found, percent(off.max()) if off.size else "–", *nothing, faults])
    return head, out


def _of(k: int, n: int) -> str:
    return f"{count(k)} ({percent(k / n)})" if n else "–"


def _case_table(view: View) -> HtmlTable:
    entries = [e for e in view.items("table") if isinstance(e, Mapping)]
    shown = {"vehicle": "vehicle", "noise": "noise", "excitation": "manoeuvre"}
    # What is the same for all of them stands in the table above.
    shown = {k: words for k, words in shown.items() if len({text(e, k) for e in entries}) > 1}
    head = ["hidden", "size", *shown.values(), "answers"]
    counted = ["logs", "named first", "or in a group", "largest error"]
    # What differs in nothing that is shown is one row.
    alike: dict[tuple[str, ...], list[Row]] = {}
    for e in entries:
        key = (text(e, "hidden"), *(text(e, k, "–") for k in ("size", *shown)))
        alike.setdefault(key, []).append(e)
    out = []
    for key, members in alike.items():
        answers: Counter[str] = Counter()
        for e in members:
            given = e.get("answers")
            for name, n in given.items() if isinstance(given, Mapping) else ():
                answers[str(name)] += round(finite(n) or 0)
        logs, named, group = (_total(members, k) for k in ("logs", "named_first", "in_group"))
        off = [v for e in members if (v := finite(e.get("worst_relative_error"))) is not None]
        out.append([
            key[0], prose(key[1]), *key[2:], ", ".join(f"{name} {count(n)}" for name, n in answers.most_common()),
            logs, *((named, group) if key[0] != NOTHING else ("–", "–")), percent(max(off)) if off else "–",
        ])  # fmt: skip
    return HtmlTable("By what was hidden", [*head, *counted], out, words=len(head))


def _total(entries: Sequence[Row], key: str) -> str:
    found = [n for e in entries if (n := finite(e.get(key))) is not None]
    return count(sum(found)) if found else "–"


def _wrong_table(rows: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    head = ["hidden", "answer", "candidates", "size", "noise", "manoeuvre", "vehicle", "seed", "p"]
    out = []
    for r in rows:
        if outcomes.flawless(r):
            continue
        verdict = text(r, "verdict")
        given = listing(names(r), "or" if verdict == "ambiguous" else "and")
        words = [verdict if verdict != "named" else "", given, text(r, "fault", "")]
        ranking = r.get("ranking")
        seed = finite(r.get("seed"))
        out.append([
            text(r, "hidden"), ": ".join(filter(None, words)),
            ", ".join(map(str, ranking)) if isinstance(ranking, (list, tuple)) and ranking else "–",
            *(prose(text(r, k, "–")) for k in ("size", "noise", "excitation", "vehicle")),
            "–" if seed is None else str(round(seed)), p_value(r.get("p_value")),
        ])  # fmt: skip
    return head, out


def _value(value: Any) -> str:
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return count(value)
    return number(value, 4)
