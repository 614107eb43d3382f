"""Self-contained HTML: templates with escaping on, figures inline, nothing that runs and nothing remote."""

from __future__ import annotations

import base64
import functools
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from auvnn.errors import MissingExtra
from auvnn.report import style
from auvnn.report.words import visible

if TYPE_CHECKING:
    from jinja2 import Environment

# Beyond so many points a figure goes in as pixels: as vectors it would weigh megabytes and scroll badly.
VECTOR_POINTS = 20_000
SECURITY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
PIXELS = 170  # per inch, of a figure that goes in as pixels
LONG = 12  # rows from which a table is folded away
LEAST = 0.86  # of a figure's own width, below which its letters are too small

_ELEMENTS = {
    *("svg", "g", "defs", "path", "use", "clipPath", "rect", "circle", "ellipse", "line", "polyline"),
    *("polygon", "image", "pattern", "linearGradient", "radialGradient", "stop", "text", "tspan", "marker"),
}
_ATTRIBUTES = {
    *("id", "d", "x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "rx", "ry", "width", "height", "viewBox"),
    *("transform", "style", "clip-path", "points", "href", "preserveAspectRatio", "fill", "stroke", "offset"),
    *("patternUnits", "patternTransform", "gradientUnits", "gradientTransform", "opacity", "text-anchor"),
    *("stroke-width", "fill-opacity", "stroke-opacity", "clip-rule", "fill-rule", "font-size", "font-family"),
}
SHORTEST, SENTENCE = 12, 24  # letters, up to which a cell is one word, and from which it is a sentence
LONGEST_WORD = 14  # letters, from which a name in a table may be broken
_AFTER_SIGN = re.compile(r"([_+/])(?=\w)")
_LONG_NUMBER = re.compile(r"(-?\d+\.\d\d)\d+")


@dataclass(frozen=True)
class HtmlTable:
    """A table of a page: plain cells, the first column is the row's name, the others are set to the right.

    Args:
        title: above it.
        head: names of the columns.
        rows: cells, as text.
        caption: what to see in it.
        folded: closed until it is opened; None folds what is longer than twelve rows.
        words: how many leading columns hold words, set to the left.
    """

    title: str
    head: list[str]
    rows: list[list[str]]
    caption: str = ""
    folded: bool | None = None
    words: int = 1

    @property
    def closed(self) -> bool:
        """Whether the table is folded away at first."""
        return len(self.rows) > LONG if self.folded is None else self.folded


@dataclass(frozen=True)
class Picture:
    """A figure of a page, drawn: its markup, or the reason why there is none."""

    name: str
    title: str
    caption: str
    markup: Any
    missing: str = ""
    folded: bool = False


@dataclass(frozen=True)
class Part:
    """One answer on a page; a page is one part, which may hold others (the demo's)."""

    kind: str
    title: str
    about: str
    brief: list[str]
    warnings: list[str] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    tables: list[HtmlTable] = field(default_factory=list)
    assumed: list[tuple[str, str]] = field(default_factory=list)
    story: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)
    few: int = 4


@functools.cache
def environment() -> Environment:
    """Return the templates' environment: every value is made visible and then escaped.

    Raises:
        MissingExtra: jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, PackageLoader, StrictUndefined
    except ImportError as problem:
        raise MissingExtra("jinja2", "report", "the HTML report") from problem
    found = Environment(
        loader=PackageLoader("auvnn.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        finalize=_finalize,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.filters["breakable"] = breakable
    found.filters["room"] = room
    return found


def _finalize(value: Any) -> Any:
    # Markup is ours alone, made by `figure_markup`; everything else may come from a log.
    return value if hasattr(value, "__html__") else visible(value)


def breakable(value: Any) -> Any:
    """Return a cell as markup in which a long name may be broken after `_`, `+` and `/`, and nowhere inside a word."""
    from markupsafe import Markup, escape

    text = str(escape(visible(value)))
    if max(map(len, text.split()), default=0) > LONGEST_WORD:
        text = _AFTER_SIGN.sub(r"\1<wbr>", text)
    return Markup(text)


def room(value: Any) -> str:
    """Return how wide a cell of words is kept on a narrow screen: `word` stays whole, `words` are not squeezed."""
    length = len(visible(value))
    return "word" if length <= SHORTEST else "words" if length > SENTENCE else "some"


def render(part: Part) -> str:
    """Return the whole page of a part as HTML."""
    return environment().get_template("page.html").render(part=part, security=SECURITY)


def figure_markup(figure: Figure, prefix: str, alt: str, drawing: str | None = None) -> Any:
    """Return a figure as inline SVG, or as an embedded PNG where it has very many points.

    Args:
        figure: what to show.
        prefix: unique on the page; every id in the SVG begins with it.
        alt: the description for readers who do not see it.
        drawing: the figure as SVG, where that has been made already.
    """
    from markupsafe import Markup

    wide = figure.get_figwidth()
    # On a narrow screen a figure keeps this width, at which its smallest letters can be read, and scrolls sideways.
    width = f"{wide * 1.25:.2f}in;--least:{wide * LEAST:.2f}in"
    if style.points(figure) > VECTOR_POINTS:
        data = base64.b64encode(style.png(figure, dpi=PIXELS)).decode("ascii")
        image = '<img class="plot" style="max-width:{}" alt="{}" src="data:image/png;base64,{}">'
        return Markup(image).format(width, visible(alt), data)
    drawing = sanitize_svg(drawing or style.svg(figure), prefix)
    frame = '<div class="plot" style="max-width:{}" role="img" aria-label="{}">{}</div>'
    return Markup(frame).format(width, visible(alt), Markup(drawing))


def sanitize_svg(text: str, prefix: str) -> str:
    """Return an SVG document fit to stand inside an HTML page.

    Only drawing elements and attributes from a fixed list stay; no script, style sheet, event handler,
    foreign object, animation, comment or remote address survives. Ids are prefixed, so that figures do not
    borrow each other's clipping paths, and coordinates are cut to hundredths of a point.

    Raises:
        ValueError: the text declares entities or is no SVG.
    """
    if "<!ENTITY" in text:
        raise ValueError("an SVG with entity declarations is not put into a page")
    root = ET.fromstring(text)
    if _local(root.tag) != "svg":
        raise ValueError("not an SVG document")
    _clean(root, prefix)
    # Matplotlib's only style sheet would apply to the whole page; on the root it is inherited.
    root.set("style", "stroke-linejoin:round;stroke-linecap:butt")
    root.set("width", "100%")
    root.attrib.pop("height", None)
    return ET.tostring(root, encoding="unicode")


def _clean(element: ET.Element, prefix: str) -> None:
    element.tag = _local(element.tag)
    attributes = {}
    for name, value in element.attrib.items():
        name = _local(name)
        kept = _attribute(name, value, prefix) if name in _ATTRIBUTES else None
        if kept is not None:
            attributes[name] = kept
    element.attrib.clear()
    element.attrib.update(attributes)
    if element.tag not in ("text", "tspan"):
        element.text = None
    for child in list(element):
        child.tail = child.tail if element.tag in ("text", "tspan") else None
        if not isinstance(child.tag, str) or _local(child.tag) not in _ELEMENTS:
            element.remove(child)
        else:
            _clean(child, prefix)


def _attribute(name: str, value: str, prefix: str) -> str | None:
    if name == "id":
        return f"{prefix}-{value}"
    if name == "href":
        if value.startswith("#"):
            return f"#{prefix}-{value[1:]}"
        return value if value.startswith("data:image/png;base64,") else None
    if re.search(r"url\(\s*(?!#)|expression|@import|javascript:", value, re.IGNORECASE):
        return None
    if name in ("d", "points", "x", "y", "width", "height"):
        return " ".join(_LONG_NUMBER.sub(r"\1", value).split())
    return value.replace("url(#", f"url(#{prefix}-")


def _local(tag: Any) -> str:
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""


def folded(pictures: list[Picture], shown: int) -> list[Picture]:
    """Return the pictures, all but the first ones folded away."""
    left, out = shown, []
    for item in pictures:
        out.append(item if left > 0 else replace(item, folded=True))
        left -= not item.folded and not item.missing
    return out


def closed(tables: list[HtmlTable], shown: int) -> list[HtmlTable]:
    """Return the tables that have rows, folded away beyond the first ones unless they say otherwise."""
    left, out = shown, []
    for item in tables:
        if item.rows:
            out.append(replace(item, folded=True) if item.folded is None and left <= 0 else item)
            left -= not item.closed
    return out
