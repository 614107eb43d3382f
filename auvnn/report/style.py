"""How every figure looks: sizes, type, inks that stay apart in grey, and symbols with their units."""

from __future__ import annotations

import functools
import io
import re
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal, ParamSpec

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.layout_engine import PlaceHolderLayoutEngine
from matplotlib.ticker import FuncFormatter, ScalarFormatter

P = ParamSpec("P")

_UPRIGHT = re.compile(r"\$\\mathdefault\{(.*)\}\$")

# Inches: one column and the full width of a two-column journal page.
COLUMN = 3.5
PAGE = 7.16

VELOCITY = (("u", "m/s"), ("v", "m/s"), ("w", "m/s"), ("p", "rad/s"), ("q", "rad/s"), ("r", "rad/s"))
ACCELERATION = tuple((rf"\dot{{{s}}}", f"{unit}²") for s, unit in VELOCITY)
WRENCH = (("X", "N"), ("Y", "N"), ("Z", "N"), ("K", "N m"), ("M", "N m"), ("N", "N m"))
MOTIONS = ("surge", "sway", "heave", "roll", "pitch", "yaw")


@dataclass(frozen=True)
class Look:
    """One ink: colour, dash pattern, width, marker and hatch differ, so that no reader needs the colour."""

    color: str
    dashes: Any
    width: float
    marker: str
    hatch: str = ""


# Luminance 0, 0.30, 0.47, 0.62: apart for colour-blind readers and on a grey printer.
MEASURED = Look("#000000", "-", 0.9, "o")
AFTER = Look("#0060a8", (0, (4, 1.2)), 1.1, "s", "////")
BEFORE = Look("#d55e00", (0, (1.6, 1.1)), 1.1, "^", "\\\\\\\\")
REFITTED = Look("#56b4e9", (0, (9, 1.2, 1.5, 1.2)), 1.7, "D", "...")
PERSISTENCE = Look("#7f7f7f", (0, (1, 2)), 1.1, "x", "xxx")
LOOKS = {"measured": MEASURED, "model": BEFORE, "as given": BEFORE, "refitted": REFITTED, "after": AFTER}

INK = "#000000"
FAINT = "#8a8a8a"
SHADE = "#e6e6e6"
BAR = "#9ec3df"

_RC: dict[Any, Any] = {
    # STIX ships with matplotlib: the same glyphs everywhere, and close to what journals set.
    "font.family": ["STIXGeneral", "DejaVu Sans"],
    "mathtext.fontset": "stix",
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "figure.titlesize": 9,
    "figure.facecolor": "white",
    "figure.dpi": 100,
    "axes.facecolor": "white",
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": False,
    "axes.xmargin": 0.01,
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.use_mathtext": True,
    "grid.linewidth": 0.4,
    "grid.color": "#d0d0d0",
    "xtick.direction": "out",
    "ytick.direction": "out",
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "xtick.major.size": 3,
    "ytick.major.size": 3,
    "xtick.minor.size": 1.8,
    "ytick.minor.size": 1.8,
    "lines.linewidth": 1.0,
    "lines.markersize": 3.5,
    "hatch.linewidth": 0.5,
    "patch.linewidth": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "savefig.facecolor": "white",
    "svg.fonttype": "path",
    # Equal data give equal files.
    "svg.hashsalt": "auvnn",
}
_FAMILIES = (
    *("axes", "axes3d", "boxplot", "contour", "errorbar", "figure", "font", "grid", "hatch", "hist", "image"),
    *("legend", "lines", "markers", "mathtext", "patch", "path", "pcolor", "pcolormesh", "polaraxes"),
    *("savefig", "scatter", "svg", "text", "xaxis", "xtick", "yaxis", "ytick"),
)
_IGNORED = {"savefig.directory", "figure.hooks"}


@contextmanager
def context() -> Iterator[None]:
    """Draw as this floor draws, whatever a user's matplotlibrc or notebook has set, and leave that alone."""
    base: dict[Any, Any] = {
        k: v for k, v in mpl.rcParamsDefault.items() if k.split(".")[0] in _FAMILIES and k not in _IGNORED
    }
    with mpl.rc_context({**base, **_RC}), warnings.catch_warnings():
        # A name in a script that no bundled font has is drawn as boxes; the page says it in text.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        yield


class Numbers(ScalarFormatter):
    """Tick labels as plain text, and only a common factor as mathematics.

    Typesetting every number of every axis as a formula takes a third of the time that a page of figures needs.
    """

    def __call__(self, x: float, pos: int | None = None) -> str:
        """Return the label of a tick."""
        label = super().__call__(x, pos)
        plain = _UPRIGHT.fullmatch(label)
        return label if plain is None else plain.group(1)


class Drawing(Figure):
    """A Figure that a notebook can show without pyplot."""

    def add_subplot(self, *args: Any, **options: Any) -> Axes:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Add axes whose numbers are plain text."""
        axes = super().add_subplot(*args, **options)
        for axis in (axes.xaxis, axes.yaxis):
            if type(axis.get_major_formatter()) is ScalarFormatter:
                axis.set_major_formatter(Numbers())
                axis.isDefault_majfmt = True
        return axes

    def _repr_png_(self) -> bytes:
        return png(self, dpi=150)


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a plotting function draw in the style of this floor."""

    @functools.wraps(draw)
    def inner(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with context():
            return draw(*args, **kwargs)

    return inner


def new_figure(width: float = PAGE, height: float = 3.0) -> Drawing:
    """Return an empty figure (inches) with an Agg canvas and constrained layout, outside of pyplot."""
    figure = Drawing(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def axis_label(symbol: str, unit: str = "") -> str:
    """Return an axis label: the symbol as mathematics, the unit upright in brackets."""
    return f"${symbol}$ ({unit})" if unit else f"${symbol}$"


def show_grid(axes: Axes, axis: Literal["x", "y", "both"] = "y") -> None:
    """Lay a faint grid under the data."""
    axes.grid(True, axis=axis, which="major")


def log_scale(axes: Axes, axis: Literal["x", "y"]) -> None:
    """Make an axis logarithmic, its ticks in plain numbers; ticks between the decades are named where these are few."""
    getattr(axes, f"set_{axis}scale")("log")
    own = getattr(axes, f"{axis}axis")

    def plain(value: float, _: int | None = None) -> str:
        return f"{value:g}" if 1e-4 < value < 1e5 else f"$10^{{{np.log10(value):.0f}}}$"

    def between(value: float, _: int | None = None) -> str:
        low, high = own.get_view_interval()
        few = low > 0 and np.log10(high / low) < 1.5
        leading = round(value / 10.0 ** np.floor(np.log10(value) + 1e-9))
        return plain(value) if few and leading in (2, 5) else ""

    own.set_major_formatter(FuncFormatter(plain))
    own.set_minor_formatter(FuncFormatter(between))


def note(axes: Axes, text: str, **where: Any) -> None:
    """Write a small remark into a panel.

    Args:
        axes: of the panel.
        text: in a few words.
        **where: `x` and `y` in shares of the panel, and how it is aligned: `ha`, `va`.
    """
    place = {"x": 0.5, "y": 0.5, "ha": "center", "va": "center", **where}
    remark = axes.text(s=text, transform=axes.transAxes, fontsize=8, color="#404040", **place)
    remark.set_in_layout(False)


def settle(figure: Figure) -> Figure:
    """Lay the figure out once and for all, so that each file made of it costs one drawing instead of two."""
    if not isinstance(figure.get_layout_engine(), PlaceHolderLayoutEngine):
        with context():
            engine = figure.get_layout_engine()
            if engine is not None:
                engine.execute(figure)
            figure.set_layout_engine("none")
    return figure


def png(figure: Figure, dpi: int = 200) -> bytes:
    """Return the figure as PNG bytes, the same for the same data."""
    return _printed(figure, FigureCanvasAgg, "print_png", dpi, {"Software": None})


def svg(figure: Figure) -> str:
    """Return the figure as SVG text, the same for the same data."""
    return _printed(figure, FigureCanvasSVG, "print_svg", 72, {"Date": None, "Creator": None}).decode("utf-8")


def _printed(figure: Figure, canvas: Any, method: str, dpi: float, metadata: dict[str, Any]) -> bytes:
    stream, before = io.BytesIO(), (figure.canvas, figure.dpi)
    try:
        with context():
            if not isinstance(figure.get_layout_engine(), PlaceHolderLayoutEngine):
                figure.draw_without_rendering()
            # Not savefig: it draws everything twice whenever there is a layout engine, even an idle one.
            figure.dpi = dpi
            getattr(canvas(figure), method)(stream, metadata=metadata)
    finally:
        figure.set_canvas(before[0])
        figure.dpi = before[1]
    return stream.getvalue()


def points(figure: Figure) -> int:
    """Return how many data points a figure draws, by which a page chooses vector or pixels."""
    total = 0
    for axes in figure.axes:
        total += sum(np.size(line.get_xdata()) for line in axes.lines)
        for collection in axes.collections:
            array = collection.get_array()
            total += max(len(np.asarray(collection.get_offsets())), 0 if array is None else array.size)
        total += len(axes.patches)
    return total
