"""Is what is left white? Autocorrelation of each velocity's error, with the band that chance allows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData


@style.styled
def residual_tests(before: Mapping[str, Any], after: Mapping[str, Any]) -> Figure:
    """Draw autocorrelations without and with what the diagnosis found, one panel a degree of freedom.

    Args:
        before: `residual_tests.before` of a diagnosis.
        after: `residual_tests.after`; the same where nothing was found.

    Raises:
        NoData: no velocity was measured.
    """
    shown = {n: u for n, u in style.VELOCITY if n in (after.get("autocorrelation") or {})}
    if not shown:
        raise NoData("no velocity was measured")
    figure = style.new_figure(style.PAGE, 3.6)
    axes = figure.subplots(2, 3, sharex=True)
    values = [before, after]
    curves = [
        {n: list(np.asarray(e["value"], dtype=float)) for n, e in (v.get("autocorrelation") or {}).items()}
        for v in values
    ]
    found = curves[0] != curves[1]
    for axis, (name, _), motion in zip(axes.flat, style.VELOCITY, style.MOTIONS, strict=True):
        axis.set_title(f"{motion}, ${name}$", loc="left")
        if name not in shown:
            axis.set_axis_off()
            continue
        entry = after["autocorrelation"][name]
        lags = np.asarray(after["lags"], dtype=float)
        low, high = (np.asarray(entry[k], dtype=float) for k in ("low", "high"))
        axis.fill_between(lags, low, high, color=style.SHADE, linewidth=0, label="white noise, 99 %")
        if found and name in before["autocorrelation"]:
            _line(axis, lags, before["autocorrelation"][name]["value"], style.BEFORE, "as given")
        _line(
            axis,
            lags,
            entry["value"],
            style.AFTER if found else style.BEFORE,
            "with what was found" if found else "as given",
        )
        axis.axhline(0.0, color=style.FAINT, linewidth=0.5)
        top = max(0.3, *(float(np.nanmax(np.abs(line.get_ydata()))) for line in axis.lines))
        axis.set_ylim(-min(0.35, top), min(1.0, 1.1 * top))
    for axis in axes[-1]:
        axis.set_xlabel("lag (s)")
    for axis in axes[:, 0]:
        axis.set_ylabel("autocorrelation")
    handles, labels = next(a for a in axes.flat if a.lines).get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=3)
    return figure


def _line(axis: Any, lags: np.ndarray, value: Any, look: style.Look, label: str) -> None:
    axis.plot(
        lags,
        np.asarray(value, dtype=float),
        color=look.color,
        linestyle=look.dashes,
        linewidth=look.width,
        label=label,
    )
