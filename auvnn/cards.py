"""How an object says itself in a notebook: one line as text, a small card as HTML."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

# A card is at most so long: what is longer stands in the report.
ROWS = 12
WIDTH = 150
_STYLE = {
    "card": "border:1px solid #bbb;border-radius:6px;padding:.5em .9em;margin:.2em 0;max-width:52em;"
    "font-family:sans-serif;font-size:13px;line-height:1.4",
    "title": "font-weight:bold;font-size:14px",
    "table": "border-collapse:collapse;margin:.4em 0 .2em",
    "head": "text-align:left;font-weight:normal;opacity:.75;padding:1px .9em 1px 0;border-bottom:1px solid #bbb",
    "cell": "text-align:left;padding:1px .9em 1px 0",
    "foot": "opacity:.75",
}


@dataclass(frozen=True)
class Card:
    """What an object says about itself.

    Args:
        title: what it is.
        line: the one thing to know, without a full stop.
        sentences: a few more, most important first.
        head: names of the columns of a small table.
        rows: its cells, as text.
        foot: what else can be asked of the object.
    """

    title: str
    line: str = ""
    sentences: Sequence[str] = ()
    head: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = field(default=())
    foot: str = ""

    def text(self) -> str:
        """Return the card as one short line."""
        words = f"{self.title}: {self.line}" if self.line else self.title
        words = " ".join(words.split())
        return f"<{words if len(words) <= WIDTH else words[: WIDTH - 3] + '...'}>"

    def markup(self) -> str:
        """Return the card as HTML; whatever a log or a file says in it is escaped."""
        out = [f'<div style="{_STYLE["card"]}"><div style="{_STYLE["title"]}">{_safe(self.title)}</div>']
        out += [f"<div>{_safe(words)}</div>" for words in (self.line, *self.sentences) if words]
        if self.rows:
            head = "".join(f'<th style="{_STYLE["head"]}">{_safe(name)}</th>' for name in self.head)
            out.append(f'<table style="{_STYLE["table"]}"><tr>{head}</tr>')
            for row in list(self.rows)[:ROWS]:
                out.append(
                    "<tr>"
                    + "".join(f'<td style="{_STYLE["cell"]}">{_safe(cell)}</td>' for cell in row)
                    + "</tr>"
                )
            out.append("</table>")
            if len(self.rows) > ROWS:
                out.append(f'<div style="{_STYLE["foot"]}">and {len(self.rows) - ROWS} more</div>')
        if self.foot:
            out.append(f'<div style="{_STYLE["foot"]}">{_safe(self.foot)}</div>')
        return "".join(out) + "</div>"


class Shown:
    """Gives a class its short `repr` and its card in a notebook: it says its `card`."""

    def card(self) -> Card:
        """Return what the object says about itself."""
        return Card(type(self).__name__)

    def __repr__(self) -> str:
        return self.card().text()

    def _repr_html_(self) -> str:
        return self.card().markup()


def figure(value: Any, digits: int = 3) -> str:
    """Return a number for people: three digits, "unknown" where there is none."""
    if value is None or isinstance(value, str) or not math.isfinite(value):
        return "unknown" if value is None or not isinstance(value, str) else value
    return f"{value:.{digits}g}"


def measured(value: Any, std: Any, unit: str = "") -> tuple[str, str]:
    """Return a value with its standard deviation and unit, and its 95 % interval, as text.

    Args:
        value: in `unit`; None or not finite where it is unknown.
        std: standard deviation in `unit`; None where none is known.
        unit: written after both; none for numbers without.
    """
    shown = "" if unit in ("", "1") else f" {unit}"
    if value is None or not math.isfinite(value):
        return f"unknown{shown}", ""
    if std is None or not math.isfinite(std) or std <= 0:
        return f"{value:.4g}{shown}", ""
    digits = max(0, min(9, 1 - math.floor(math.log10(std))))
    ends = f"{value - 1.96 * std:.{digits}f} to {value + 1.96 * std:.{digits}f}{shown}"
    return f"{value:.{digits}f} ± {std:.{digits}f}{shown}", ends


PARAMETER_HEAD = ("effect", "parameter", "value ± one standard deviation", "95 % interval")


def parameter_rows(fitted: Any) -> list[list[str]]:
    """Return the rows of a table of {effect: {parameter: {value, std, unit}}}."""
    rows = []
    for effect, members in fitted.items():
        for name, entry in members.items():
            value, ends = measured(entry.get("value"), entry.get("std"), str(entry.get("unit") or ""))
            rows.append([str(effect), str(name), value, ends])
    return rows


def not_needed(gain: Any, by_effect: Any) -> str:
    """Return in words which of several effects does not add to the others; empty where that is not why none is accepted.

    Args:
        gain: fall of the held-out error by all of them, {value, std}.
        by_effect: effect to what it brings in addition to the others, see `improvement.json`.
    """
    idle = {str(name): entry["gain"] for name, entry in by_effect.items() if not entry["accepted"]}
    if not idle or not _finite(gain) or not gain["value"] > gain["std"]:
        return ""
    unjudged = [name for name, own in idle.items() if not _finite(own)]
    if unjudged:
        return f"what {', '.join(unjudged)} would add to the others could not be judged"
    if len(idle) > 1:
        return f"{', '.join(idle)} do not add to what the others bring: leave one of them out"
    ((name, own),) = idle.items()
    does = (
        "makes the prediction worse"
        if own["value"] < -own["std"]
        else "adds nothing to what the others bring"
    )
    return f"{name} {does}: leave it out"


# An error that is larger than another one by no more than this share is about as good.
ALIKE = 1.05


def still_beaten(baseline: Any) -> str:
    """Return in words that what needs no model predicts better than a model does; empty where nothing does.

    Args:
        baseline: the model's errors beside those of a plain regression and of holding the initial velocity, see
            `improvement.json`.
    """
    line = baseline or {}
    own = (line.get("model") or {}).get("total")
    others = {
        "a plain regression": line.get("total"),
        "holding the initial velocity": (line.get("persistence") or {}).get("total"),
    }
    if own is None:
        return ""
    # A model that diverges has no finite error: what has one is better.
    better = {
        k: v
        for k, v in others.items()
        if v is not None and math.isfinite(v) and not (math.isfinite(own) and own <= ALIKE * v)
    }
    if not better:
        return ""
    who = " and ".join(f"{k} ({figure(v)})" for k, v in better.items())
    verb = "predict" if len(better) > 1 else "predicts"
    size = f" ({figure(own)})" if math.isfinite(own) else ", which diverges"
    return (
        f"{who} still {verb} better than this model{size}: more is missing than was added; `auvnn improve`, or `auvnn "
        "diagnose` of this model, looks for it"
    )


def _finite(gain: Any) -> bool:
    return all(x is not None and math.isfinite(x) for x in (gain.get("value"), gain.get("std")))


def _safe(text: Any) -> str:
    import html  # for cards alone: every command imports this file

    # A file name that is not UTF-8 stands in Python's strings as lone surrogates, which no page can hold.
    return html.escape(str(text).encode("utf-8", "replace").decode("utf-8"))


class Text(str):
    """Several lines of text that a notebook shows as they are, not as a quoted string."""

    def __repr__(self) -> str:
        """Return the text itself."""
        return str(self)
