"""How often the hidden effect was named first, by effect and size, and how sure these shares are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from statistics import NormalDist

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import label, prose

ORDER = ("small", "medium", "large")
LOOKS = {"small": style.REFITTED, "medium": style.AFTER, "large": style.MEASURED}
ALL = "all effects"
_NUMBER = re.compile(r"\d+(\.\d+)?")
STEP = 0.165  # inches from one marker to the next, less where there are many effects
TALLEST = 10.0  # inches


@style.styled
def recovery(
    found: Mapping[str, Mapping[str, tuple[int, int]]],
    *,
    target: float | None = None,
    share: str = "hidden effect named first",
    among: Iterable[str] = (),
) -> Figure:
    """Draw the share of logs in which each effect was named first, a marker with its 95 % interval per size.

    All effects together stand on top. The intervals are Wilson's.

    Args:
        found: {effect: {size: (logs in which it was named first, logs)}}.
        target: a share that is aimed at, drawn as an upright line.
        share: what is counted, for the axis.
        among: all sizes of which these are some, so that one size looks the same in every figure.

    Raises:
        NoData: no log hides an effect.
    """
    rows = {e: {s: (k, n) for s, (k, n) in by.items() if n > 0} for e, by in found.items()}
    rows = {e: by for e, by in rows.items() if by}
    if not rows:
        raise NoData("no log hides an effect")
    sizes = sizes_of(rows)
    looks = {size: look_of(size, k) for k, size in enumerate(in_order([*among, *sizes]))}
    if len(rows) > 1:
        total = {s: _sum(by[s] for by in rows.values() if s in by) for s in sizes}
        rows = {ALL: total, **rows}
    height = min(max(2, len(sizes)) * STEP + 0.09, TALLEST / len(rows))
    step = (height - 0.09) / max(2, len(sizes)) / height
    figure = style.new_figure(style.PAGE * 0.86, 0.95 + height * len(rows))
    ax = figure.subplots()
    handles = {}
    for i, (effect, by_size) in enumerate(rows.items()):
        if i % 2 == (effect == ALL):
            ax.axhspan(i - 0.5, i + 0.5, fc="#f4f4f4", ec="none", zorder=0)
        for k, size in enumerate(sizes):
            if size in by_size:
                y = i + (k - (len(sizes) - 1) / 2) * step
                handles[size] = _marker(ax, y, *by_size[size], looks[size])
    if target is not None:
        line = ax.axvline(100 * target, color=style.BEFORE.color, ls=(0, (4, 2)), lw=1.1, zorder=1.5)
        handles[f"target: {100 * target:.0f} % of all"] = line
    if len(rows) > 1:
        ax.axhline(0.5, color=style.INK, lw=0.6)
    ax.set_yticks(range(len(rows)), [label(effect, 30) for effect in rows])
    ax.get_yticklabels()[0].set_fontweight("bold" if len(rows) > 1 else "normal")
    ax.tick_params(axis="y", length=0)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.set_xlim(-1, 101)
    ax.set_xlabel(f"{share} (% of the logs; 95 % interval)")
    style.show_grid(ax, "x")
    ordered = [s for s in sizes if s in handles] + [h for h in handles if h not in sizes]
    drawn = [handles[name] for name in ordered]
    figure.legend(
        drawn, [prose(label(name)) for name in ordered], loc="outside upper center", ncols=len(drawn)
    )
    return figure


def sizes_of(found: Mapping[str, Mapping[str, object]]) -> list[str]:
    """Return the sizes that occur, the known ones from small to large, then the others."""
    return in_order(size for by_size in found.values() for size in by_size)


def in_order(sizes: Iterable[str]) -> list[str]:
    """Return the names of sizes, each once: the known ones from small to large, numbers rising, then the others."""
    known = list(dict.fromkeys(sizes))
    numbers = sorted((s for s in known if _NUMBER.match(s)), key=lambda s: float(_NUMBER.match(s)[0]))  # type: ignore[index]
    named = [s for s in ORDER if s in known]
    return [*named, *numbers, *(s for s in known if s not in (*named, *numbers))]


def look_of(size: str, k: int) -> style.Look:
    """Return how the marker of a size is drawn, the k-th of a figure."""
    return LOOKS.get(size) or (style.REFITTED, style.AFTER, style.MEASURED, style.BEFORE)[k % 4]


def wilson(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return Wilson's interval of a share, which stays within 0 and 1 and has a width at 0 and 1 too.

    (p + z²/2n ± z sqrt(p (1 - p)/n + z²/4n²)) / (1 + z²/n)

    Args:
        successes: how many.
        trials: of how many, n.
        confidence: that the share lies within.

    References:
        Wilson, E. B. (1927), J. Am. Stat. Assoc. 22(158), 209-212.
    """
    if trials <= 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    p, scale = successes / trials, 1 + z**2 / trials
    middle = (p + z**2 / (2 * trials)) / scale
    half = z * math.sqrt(p * (1 - p) / trials + z**2 / (4 * trials**2)) / scale
    # At none and at all the end is exact; rounding would leave a speck beside it.
    low = 0.0 if successes == 0 else middle - half
    return low, 1.0 if successes == trials else middle + half


def _marker(ax: Axes, y: float, named: int, logs: int, look: style.Look) -> object:
    share, (low, high) = named / logs, wilson(named, logs)
    # A bar cannot have a negative side, which rounding makes of an end on the marker itself.
    sides = [[100 * max(share - low, 0.0)], [100 * max(high - share, 0.0)]]
    drawn = ax.errorbar(100 * share, y, xerr=sides, fmt=look.marker, color=look.color, ms=4.2, capsize=2,
                        lw=1, clip_on=False, zorder=3)  # fmt: skip
    for part in (*drawn.lines[1], *drawn.lines[2]):
        part.set_clip_on(False)
    ax.text(1.03, y, f"{named} of {logs}", transform=ax.get_yaxis_transform(), va="center", fontsize=7,
            color="#303030")  # fmt: skip
    return drawn


def _sum(pairs: Iterable[tuple[int, int]]) -> tuple[int, int]:
    counts = list(pairs)
    return sum(k for k, _ in counts), sum(n for _, n in counts)
