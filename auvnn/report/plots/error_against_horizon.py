"""Free-running error against the horizon, compared with persistence."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import finite, label

# Broad and pale: a model that reaches it lies on it, and both are seen.
_FLOOR = style.Look("#b8b8b8", "-", 0.9, "None")
# Beyond three models: still apart by colour, dashes and marker.
_FURTHER = (
    style.Look("#009e73", "-", 1.1, "v"),
    style.Look("#cc79a7", (0, (3, 1, 1, 1)), 1.1, "P"),
    style.Look("#b08800", (0, (6, 2)), 1.1, "*"),
)


@style.styled
def error_against_horizon(
    models: Mapping[str, Mapping[str, float | None]],
    persistence: Mapping[str, float | None] | None = None,
    floor: Mapping[str, float | None] | None = None,
) -> Figure:
    """Draw the error over the free-running horizon: one line per model, and that of holding the velocity.

    Args:
        models: name of the model to {horizon: total nrmse}; a horizon is seconds as text ("0.5", "5") or
            "full" for whole runs, which stands apart on the right.
        persistence: {horizon: total nrmse} of holding the initial velocity.
        floor: {horizon: total nrmse} that noise alone would leave to a perfect model.

    Raises:
        NoData: no horizon has an error.
    """
    known = {h for m in models.values() for h, error in m.items() if finite(error) is not None}
    horizons = sorted({s for h in known if (s := _seconds(h)) is not None})
    full = "full" in known
    if not known:
        raise NoData("no horizon has an error")
    end = (horizons[-1] if horizons else 1.0) * 2.2
    figure = style.new_figure(style.COLUMN * 1.25, 2.7)
    ax = figure.subplots()
    looks = [style.BEFORE, style.AFTER, style.REFITTED, *_FURTHER]
    names = {"as given": style.BEFORE, "refitted": style.REFITTED, "after": style.AFTER}
    for i, (name, errors) in enumerate(models.items()):
        # The first on top: where a later one coincides, both marks stay visible.
        _line(ax, errors, end, names.get(name) or looks[i % len(looks)], name, 10 - i)
    if persistence:
        _line(ax, persistence, end, style.PERSISTENCE, "initial velocity held", 1)
    if floor and any(finite(v) is not None for v in floor.values()):
        _line(ax, floor, end, _FLOOR, "noise alone", 0.8, width=3.5)
    ax.axhline(1.0, color=style.FAINT, lw=0.6)
    ax.set_xscale("log")
    ticks = horizons + ([end] if full else [])
    ax.xaxis.set_major_locator(FixedLocator(ticks))
    ax.xaxis.set_minor_locator(NullLocator())
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xticks(ticks, [f"{h:g}" for h in horizons] + (["whole\nrun"] if full else []), linespacing=0.85)
    ax.set_xlabel("free-running horizon (s)")
    # Said at the axis: among the lines a label would cover some of them.
    ax.set_ylabel("error / spread of the motion\n(nrmse; 1: as the motion)")
    top = ax.get_ylim()[1]
    ax.set_ylim(0, max(top, 1.15))
    style.show_grid(ax, "y")
    figure.legend(loc="outside upper center", ncols=2)
    return figure


def _seconds(horizon: str) -> float | None:
    try:
        value = float(horizon)
    except (TypeError, ValueError):
        return None
    return value if value > 0 and np.isfinite(value) else None


def _line(
    ax: Axes,
    errors: Mapping[str, float | None],
    end: float,
    look: style.Look,
    name: str,
    order: float,
    width: float = 1.2,
) -> None:
    known = {
        s: v for h, e in errors.items() if (s := _seconds(h)) is not None and (v := finite(e)) is not None
    }
    seconds = sorted(known)
    marks = {"color": look.color, "marker": look.marker, "mfc": "white", "mec": look.color, "mew": 0.9}
    options = {"ls": look.dashes, "lw": width, "label": label(name), "zorder": order}
    ax.plot(seconds, [known[s] for s in seconds], **options, **marks)
    whole = finite(errors.get("full"))
    if whole is not None:
        # Where a line has no marks, a short stroke stands for the whole run.
        stroke = {"marker": "_", "ms": 12, "mew": 3.5} if look is _FLOOR else {}
        ax.plot([end], [whole], ls="none", zorder=order, **{**marks, **stroke})
