"""How much each degree of freedom moves, against the noise of its sensor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, label, number

ENOUGH = 3.0


@style.styled
def excitation(channels: Sequence[Mapping[str, Any]], enough: float = ENOUGH) -> Figure:
    """Draw the spread of each channel over its noise, on a logarithmic axis.

    Args:
        channels: {channel, std, noise, unit}, spread and noise in that unit; instead of the two, `ratio`.
        enough: below this ratio a channel counts as not excited.

    Raises:
        NoData: no channel has a spread and a noise.
    """
    known = [(c, r) for c in channels if (r := motion_over_noise(c)) is not None]
    if not known:
        raise NoData("no channel has a spread and a noise")
    figure = style.new_figure(style.COLUMN * 1.4, 0.75 + 0.27 * len(known))
    ax = figure.subplots()
    floor = min(0.5, min(r for _, r in known) / 1.5)
    for i, (channel, ratio) in enumerate(known):
        good = ratio >= enough
        look = style.AFTER if good else style.BEFORE
        ax.barh(
            i,
            ratio - floor,
            left=floor,
            height=0.62,
            fc=style.BAR if good else "#f3c9a8",
            ec=look.color,
            hatch="" if good else look.hatch,
        )
        unit = str(channel.get("unit") or "")
        std = finite(channel.get("std"))
        words = f"× {number(ratio, 2)}" + (f"   ({number(std, 2)} {label(unit)})" if std is not None else "")
        ax.text(
            1.02,
            i,
            words,
            va="center",
            fontsize=8,
            transform=ax.get_yaxis_transform(),
            weight="normal" if good else "bold",
        )
    ax.set_xscale("log")
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.set_xlim(floor, max(max(r for _, r in known) * 1.4, 2 * enough))
    ax.axvline(enough, color=style.INK, lw=0.8, ls=(0, (4, 2)))
    ax.set_ylim(len(known) - 0.4, -0.6)
    ax.set_yticks(range(len(known)), [label(c.get("channel", "?"), 18) for c, _ in known], style="italic")
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(f"spread of the motion / noise (dashed: {enough:g}, the least that counts)")
    return figure


def motion_over_noise(channel: Mapping[str, Any]) -> float | None:
    """Return spread over noise, or None where it is unknown or not positive."""
    ratio = finite(channel.get("ratio"))
    if ratio is None:
        std, noise = finite(channel.get("std")), finite(channel.get("noise"))
        ratio = std / noise if std is not None and noise else None
    return ratio if ratio is not None and ratio > 0 else None
