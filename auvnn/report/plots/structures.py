"""Structures of a model side by side: free-running error on data held out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import count, finite, label

LOOKS = (style.AFTER, style.BEFORE, style.REFITTED)


@style.styled
def structures(rows: Sequence[Mapping[str, Any]], errors: Mapping[str, str]) -> Figure:
    """Draw one row per structure and one marker per training data, in one panel for each held-out manoeuvre.

    Args:
        rows: {structure, trained_on, parameters, and the keys of `errors`}.
        errors: key of an error over the range (1) to the panel's title.

    Raises:
        NoData: no row has an error.
    """
    names = list(dict.fromkeys(str(r["structure"]) for r in rows))
    data = list(dict.fromkeys(str(r["trained_on"]) for r in rows))
    if not any(finite(r.get(key)) for r in rows for key in errors):
        raise NoData("no structure was compared")
    figure = style.new_figure(style.PAGE, 0.95 + 0.3 * len(names))
    panels = figure.subplots(1, len(errors), sharey=True, squeeze=False)[0]
    handles: dict[str, Any] = {}
    for ax, (key, title) in zip(panels, errors.items(), strict=True):
        for k, (trained, look) in enumerate(zip(data, LOOKS, strict=False)):
            own = [r for r in rows if r["trained_on"] == trained and (finite(r.get(key)) or 0) > 0]
            x = [100.0 * float(r[key]) for r in own]
            y = [names.index(str(r["structure"])) + 0.14 * (k - (len(data) - 1) / 2) for r in own]
            handles[f"trained on: {trained}"] = ax.plot(
                x,
                y,
                ls="none",
                marker=look.marker,
                ms=5.5,
                color=look.color,
                mfc="white" if k else look.color,
            )[0]
        style.log_scale(ax, "x")
        ax.margins(x=0.08)
        ax.set_xlabel("rms error (% of the range)")
        ax.set_title(label(title, 60), fontsize=8)
        style.show_grid(ax, "both")
    sizes = {str(r["structure"]): r.get("parameters") for r in rows}
    panels[0].set_yticks(
        range(len(names)), [f"{label(n.replace('_', ' '))} ({count(sizes[n])})" for n in names]
    )
    panels[0].set_ylim(len(names) - 0.5, -0.5)
    panels[0].set_ylabel("structure (numbers learned)")
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=len(handles))
    return figure
