"""The damping that was learned, against the velocity that it opposes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.decimate import decimate
from auvnn.report.panels import NoData, six_panels
from auvnn.report.words import finite


@style.styled
def damping_curves(curves: Sequence[Mapping[str, Any]], words: str = "learned") -> Figure:
    """Draw d_i over nu_i, the other velocities zero; where the log has been is shaded.

    Args:
        curves: one per degree of freedom, in order, {nu: (k,) m/s or rad/s, learned: (k,) N or N m,
            nominal: (k,) or None, low: (k,) and high: (k,) or None (a 95 % band), covered: (low, high) or
            None: the range of nu_i in the data}. An empty mapping leaves its panel empty.
        words: what the curve called `learned` is.

    Raises:
        NoData: no degree of freedom has a curve.
    """
    if not any(np.size(c.get("learned", ())) for c in curves):
        raise NoData("no degree of freedom has a learned curve")
    figure, axes = six_panels(5.2, sharex=False)
    handles: dict[str, Any] = {}
    for i, (ax, (symbol, unit), (force, force_unit)) in enumerate(
        zip(axes, style.VELOCITY, style.WRENCH, strict=True)
    ):
        curve = curves[i] if i < len(curves) else {}
        ax.set_xlabel(style.axis_label(symbol, unit), labelpad=1)
        ax.set_ylabel(style.axis_label(f"d_{force}", force_unit))
        nu, learned = np.asarray(curve.get("nu", ()), float), np.asarray(curve.get("learned", ()), float)
        if not nu.size or nu.size != learned.size:
            style.note(ax, "nothing learned")
            ax.set_xticks([])
            ax.set_yticks([])
            continue
        covered = curve.get("covered")
        if covered is not None and len(covered) == 2 and all(finite(c) is not None for c in covered):
            handles["range of the data"] = ax.axvspan(*covered, fc=style.SHADE, ec="none", zorder=0)
        ax.axhline(0, color=style.FAINT, lw=0.5)
        ax.axvline(0, color=style.FAINT, lw=0.5)
        low, high = curve.get("low"), curve.get("high")
        if low is not None and high is not None:
            handles["95 % band"] = ax.fill_between(
                nu, low, high, fc=style.BAR, ec="none", alpha=0.7, zorder=1
            )
        nominal = curve.get("nominal")
        if nominal is not None and np.size(nominal) == nu.size:
            look = style.BEFORE
            handles["nominal"] = ax.plot(
                *decimate(nu, nominal), color=look.color, ls=look.dashes, lw=1.2, zorder=3
            )[0]
        handles[words] = ax.plot(*decimate(nu, learned), color=style.AFTER.color, lw=1.3)[0]
        ax.margins(x=0)
    figure.align_ylabels()
    figure.legend(handles.values(), handles.keys(), loc="outside upper center", ncols=len(handles))
    return figure
