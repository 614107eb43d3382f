"""Tables of the page of `diagnose`: what each name costs, what predicts a part, and what is left."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.report.html import HtmlTable
from auvnn.report.pages import common
from auvnn.report.view import View
from auvnn.report.words import finite, number, percent

AXES = ("X", "Y", "Z", "K", "M", "N")


def judged_tables(view: View) -> list[HtmlTable]:
    """Return the tables, empty ones included: the page leaves these out."""
    return [_costs(view), *_joint(view), _left(view), _moved(view)]


def _costs(view: View) -> HtmlTable:
    rows = []
    for name, entry in view.mapping("matters").items():
        worst = entry.get("worst") or {}
        rows.append([
            str(name), "yes" if entry.get("matters") else "no", percent(entry.get("cost")),
            f"{worst.get('velocity', '–')} {percent(worst.get('cost'))}" if worst else "–",
            _gain(entry.get("gain")), percent(entry.get("share")),
            *(number((entry.get("force") or {}).get(a)) for a in AXES),
        ])  # fmt: skip
    tolerance = view.mapping("tolerance")
    caption = (
        "Cost: by how much the error of free running over 5 s on runs left out is larger without the name, everything "
        f"else refitted ({view.text('judged_by') or 'not worked out'}). Force: root mean square along the log, N and "
        f"N m, and its largest share of the actuators'. A name matters that costs "
        f"{percent(tolerance.get('cost'))} or more, or exerts {percent(tolerance.get('force'))} or more."
    )
    head = ["effect", "matters", "cost", "worst velocity", "fall of the error", "share", *AXES]
    return HtmlTable("Does it matter?", head, rows, caption)


def _joint(view: View) -> list[HtmlTable]:
    joint = view.mapping("joint")
    if not joint:
        return []
    rows = [
        [
            str(name), "; ".join(map(str, e.get("confounded_with") or [])) or "–", _gain(e.get("gain")),
            *(percent((e.get("explained_by_dof") or {}).get(a)) for a in AXES),
        ]
        for name, e in joint.items()
    ]  # fmt: skip
    caption = (
        "Share of what looks like a force that each name explains in addition to the others, by degree of freedom, and "
        "the fall of the error of free running on runs left out that it brings in addition to them. None of them is "
        "claimed to be the cause."
    )
    values = {str(n): e["parameters"] for n, e in joint.items() if e.get("parameters")}
    return [
        HtmlTable(
            "What predicts a part",
            ["effect", "confounded with", "fall of the error", *AXES],
            rows,
            caption,
            words=2,
        ),
        HtmlTable("Their values together", common.PARAMETER_HEAD, common.parameter_rows(values), words=2),
    ]


def _left(view: View) -> HtmlTable:
    rows = [
        [
            a,
            *(number(row.get(k)) for k in ("rms", "upper", "detectable", "correlation_time")),
            percent(row.get("share")),
        ]
        for a, row in view.mapping("left").items()
        if isinstance(row, Mapping)
    ]
    cost = finite(view.mapping("left").get("cost"))
    more = (
        ""
        if cost is None
        else f" The error of free running on runs left out is {percent(cost)} above the noise floor."
    )
    caption = (
        "A force of no known cause, smooth within a window: its root mean square, the limit below which it lies in 19 "
        "of 20 logs, and the smallest that this log would have shown in 19 of 20, N and N m; how long it stays alike, "
        f"s; its share of the actuators'.{more}"
    )
    head = ["degree of freedom", "rms", "upper limit", "would have shown", "correlation time", "share"]
    return HtmlTable("What is left", head, rows, caption)


def _moved(view: View) -> HtmlTable:
    rows = [
        [
            f"{m.get('group')}.{m.get('coefficient')}",
            *(number(m.get(k)) for k in ("stated", "fitted", "deviations")),
        ]
        for m in view.items("moved")
        if isinstance(m, Mapping)
    ]
    caption = (
        "Factors on what the model's file states. Deviations: in standard deviations that the file states."
    )
    return HtmlTable(
        "Stated coefficients that moved far", ["coefficient", "stated", "fitted", "deviations"], rows, caption
    )


def _gain(entry: Any) -> str:
    if not isinstance(entry, Mapping):
        return "–"
    return f"{number(entry.get('value'))} ± {number(entry.get('std'), 2)}"
