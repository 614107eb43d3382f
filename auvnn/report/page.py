"""What a page of any kind does: draw what can be drawn, say what cannot, and write it down whole."""

from __future__ import annotations

import functools
import os
import tempfile
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from matplotlib.figure import Figure

from auvnn.answers import write_text
from auvnn.report import style
from auvnn.report.html import HtmlTable, Part, Picture, closed, figure_markup, folded, render
from auvnn.report.panels import NoData
from auvnn.report.view import View
from auvnn.report.words import prose

T = TypeVar("T")
MOST_SENTENCES = 6
# Of the PNG files beside a page, which go into papers.
FILE_DPI = 300


@dataclass(frozen=True)
class Plot:
    """One figure of a page, not drawn yet.

    Args:
        name: of the files; letters, digits and underscores.
        title: what it is.
        draw: draws it, or raises NoData with what is missing in words.
        caption: what to see in it; a function is called after drawing.
        folded: closed until it is opened.
        lone: another one where the truth is known, so that a report of several answers must draw it again.
    """

    name: str
    title: str
    draw: Callable[[], Figure]
    caption: str | Callable[[], str]
    folded: bool = False
    lone: bool = False


@dataclass(frozen=True)
class Drawn:
    """What became of the planned figures: drawn, as SVG where that was made, or missing for a reason."""

    figures: dict[str, Figure] = field(default_factory=dict)
    vectors: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    captions: dict[str, str] = field(default_factory=dict)


class Page:
    """Base of the pages: a kind overrides what it has to say, and inherits how it is written.

    Whatever an answer lacks costs its own place on the page and nothing else; the page says so there.
    """

    kind = ""
    # How many figures and tables stand open: what tells the story; the others are folded away until they are opened.
    shown, open_tables = 3, 1

    def __init__(self, without: tuple[str, ...] = ()) -> None:
        """Make the page; `without` names figures that are shown elsewhere."""
        self.without = without

    def title(self, view: View) -> str:
        """Return the heading."""
        return self.kind

    def about(self, view: View) -> str:
        """Return the line under the heading: which model, which log."""
        return ""

    def brief(self, view: View) -> list[str]:
        """Return the verdict in plain words, three to six sentences, the most important first."""
        return []

    def warnings(self, view: View) -> list[str]:
        """Return what a reader must keep in mind."""
        return view.texts("warnings")

    def plots(self, view: View) -> list[Plot]:
        """Return the figures, the most telling first."""
        return []

    def tables(self, view: View) -> list[HtmlTable]:
        """Return the tables."""
        return []

    def assumed(self, view: View) -> list[tuple[str, str]]:
        """Return what was read and assumed, as name and value."""
        return []

    def story(self, view: View) -> list[str]:
        """Return how it came about, line by line."""
        return view.texts("story")

    def parts(self, view: View) -> list[tuple[Page, Any]]:
        """Return further pages with their answers, shown below this one."""
        return []

    def figures(self, answer: Any) -> dict[str, Figure]:
        """Return the figures of an answer by name, the most telling first; never empty."""
        drawn = draw(self.planned(View(answer)))
        return drawn.figures or {"nothing": _blank("There is nothing to draw.", drawn.reasons)}

    def page(self, answer: Any) -> str:
        """Return the answer as one complete, self-contained HTML page."""
        view = View(answer)
        plots = self.planned(view)
        return render(self.part(view, plots, draw(plots)))

    def write(self, answer: Any, folder: str | Path) -> Path:
        """Write `report.html` and `figures/*.png` and `*.svg` into a folder; return the page's path."""
        folder, view = Path(folder), View(answer)
        plots = self.planned(view)
        drawn = draw(plots)
        for name in list(drawn.figures):
            pixels = _rendered(drawn, name)
            if pixels is not None:
                _write_bytes(folder / "figures" / f"{name}.png", pixels)
                write_text(folder / "figures" / f"{name}.svg", drawn.vectors[name])
        page = self.part(view, plots, drawn)
        _keep(answer, self.kind, plots, drawn)
        return write_text(folder / "report.html", render(page))

    def planned(self, view: View) -> list[Plot]:
        """Return the figures, or where they cannot be planned one that says why."""
        try:
            return [plot for plot in self.plots(view) if plot.name not in self.without]
        except Exception as problem:
            reason = f"the figures could not be prepared ({type(problem).__name__}: {problem})"
            return [Plot("nothing", "Figures", functools.partial(_missing, reason), str)]

    def part(self, view: View, plots: list[Plot], drawn: Drawn, prefix: str = "") -> Part:
        """Return everything that the page shows, as the templates take it.

        Args:
            view: the answer that is shown.
            plots: that are planned.
            drawn: what came of drawing them.
            prefix: before the names of parts, so that those of several pages differ.
        """
        notes: list[str] = []
        safely = functools.partial(_safely, notes)
        parts = []
        for other, answer in safely("the parts of this report", lambda: self.parts(view), []):
            inner = answer if isinstance(answer, View) else View(answer)
            plans = other.planned(inner)
            drawn_before = _kept_of(inner.answer, other.kind)
            parts.append(other.part(inner, plans, draw(plans, drawn_before), prefix=f"{other.kind}-"))
        return Part(
            kind=self.kind,
            title=safely("the title", lambda: self.title(view), self.kind),
            about=safely("the subject", lambda: self.about(view), ""),
            brief=safely("the verdict", lambda: _prose(self.brief(view)[:MOST_SENTENCES]), [])
            or ["There is no verdict in this answer."],
            warnings=safely("the warnings", lambda: _prose(self.warnings(view)), []),
            pictures=folded(
                [_picture(plot, drawn, prefix, notes) for plot in plots], 1 if prefix else self.shown
            ),
            tables=closed(
                safely("the tables", lambda: self.tables(view), []), 0 if prefix else self.open_tables
            ),
            assumed=[(k, v) for k, v in safely("what was assumed", lambda: self.assumed(view), []) if v],
            notes=notes,
            story=safely("the story", lambda: _prose(self.story(view)), []),
            parts=parts,
        )


def _prose(lines: list[str]) -> list[str]:
    return [prose(line) for line in lines]


def _missing(reason: str) -> Figure:
    raise NoData(reason)


# What was drawn of an answer, while the answer lives: a report of several answers shows it again.
_kept: dict[tuple[int, str], Drawn] = {}


def _keep(answer: Any, kind: str, plots: list[Plot], drawn: Drawn) -> None:
    lone = {plot.name for plot in plots if plot.lone}
    places = [{n: v for n, v in getattr(drawn, f).items() if n not in lone} for f in ("figures", "vectors")]
    captions = {n: v for n, v in drawn.captions.items() if n not in lone}
    key = (id(answer), kind)
    try:
        weakref.finalize(answer, _kept.pop, key, None)
    except TypeError:
        # Plain mappings cannot be watched; theirs are drawn again.
        return
    _kept[key] = Drawn(*places, captions=captions)


def _kept_of(answer: Any, kind: str) -> Drawn:
    return _kept.get((id(answer), kind), Drawn())


def draw(plots: list[Plot], before: Drawn | None = None) -> Drawn:
    """Return the figures that could be drawn by name, and for the others why not.

    Args:
        plots: what to draw.
        before: what has been drawn of the same answer already.
    """
    drawn = Drawn()
    for plot in plots:
        if before is not None and plot.name in before.vectors and plot.name in before.captions:
            drawn.figures[plot.name] = before.figures[plot.name]
            drawn.vectors[plot.name] = before.vectors[plot.name]
            drawn.captions[plot.name] = before.captions[plot.name]
            continue
        try:
            drawn.figures[plot.name] = plot.draw()
        except NoData as reason:
            drawn.reasons[plot.name] = str(reason)
        except Exception as problem:
            # A page with a hole that says why is worth more than no page after an hour of computing.
            drawn.reasons[plot.name] = f"it could not be drawn ({type(problem).__name__}: {problem})"
    return drawn


def _rendered(drawn: Drawn, name: str) -> bytes | None:
    """Render a figure to SVG (kept) and PNG (returned); one that cannot be rendered becomes a missing one."""
    figure = drawn.figures[name]
    try:
        drawn.vectors[name] = style.svg(style.settle(figure))
        return style.png(figure, dpi=FILE_DPI)
    except Exception as problem:
        del drawn.figures[name]
        drawn.reasons[name] = f"it could not be rendered ({type(problem).__name__}: {problem})"
        return None


def _picture(plot: Plot, drawn: Drawn, prefix: str, notes: list[str]) -> Picture:
    name = prefix + plot.name
    figure = drawn.figures.get(plot.name)
    if figure is None:
        return Picture(name, plot.title, "", "", missing=drawn.reasons.get(plot.name, "it was not drawn"))
    caption = drawn.captions.get(plot.name, plot.caption)
    if callable(caption):
        caption = _safely(notes, f"the caption of '{plot.title}'", caption, "")
    drawn.captions[plot.name] = caption
    try:
        markup = figure_markup(style.settle(figure), name, plot.title, drawn.vectors.get(plot.name))
        return Picture(name, plot.title, caption, markup, folded=plot.folded)
    except Exception as problem:
        return Picture(name, plot.title, "", "", missing=f"it could not be drawn ({problem})")


def _safely(notes: list[str], what: str, make: Callable[[], T], fallback: T) -> T:
    try:
        return make()
    except Exception as problem:
        notes.append(f"{what}: {type(problem).__name__}: {problem}")
        return fallback


def _blank(words: str, reasons: dict[str, str]) -> Figure:
    figure = style.new_figure(style.COLUMN, 1.2)
    reason = "; ".join(dict.fromkeys(reasons.values()))
    figure.text(0.5, 0.5, f"{words}\n{reason[:80]}".replace("$", r"\$"), ha="center", va="center")
    return figure


def _write_bytes(path: Path, data: bytes) -> None:
    """Write a file beside its place and move it there."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
