"""The error budget: what each step took off, by what kind of step it was, between the model as given and noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.words import MINUS, finite, label

FLOOR = "noise floor"
HEIGHT = 0.62
# Errors that span more than this are drawn on a logarithmic axis.
WIDE = 6.0
# Face and hatch of each kind of step; they differ in hatch too, for who prints in grey.
KINDS = {
    "as given": ("#9aa3ab", ""),
    "coefficients refitted": ("#5b7fa6", ""),
    "a cause with a name": ("#2f6b4f", ""),
    "a name that only predicts": ("#a9cbb7", "//"),
    "learned": ("#d8b365", ".."),
    "left": ("white", "----"),
}
LINES = {"plain regression": (0, (5, 2)), "velocity held": (0, (1, 1.5))}


@style.styled
def budget(
    steps: Sequence[Mapping[str, Any]], lines: Mapping[str, float | None], unit: str = "nrmse over 5 s"
) -> Figure:
    """Draw the error that is left after each step as a bar, coloured by what kind of step it was.

    Args:
        steps: in order, {step, kind, error}; the last may be "noise floor".
        lines: name to error of what needs no model, drawn as lines across.
        unit: what the error is.

    Raises:
        NoData: no step has an error.
    """
    known = [
        (str(s.get("step", "?")), str(s.get("kind", "")), e)
        for s in steps
        if (e := finite(s.get("error"))) is not None
    ]
    if not known:
        raise NoData("no step has an error")
    there = [k for k in KINDS if any(kind == k for _, kind, _ in known)]
    figure = style.new_figure(style.PAGE, 1.3 + 0.2 * ((len(there) + 2) // 3) + 0.34 * len(known))
    ax = figure.subplots()
    errors = [e for _, _, e in known]
    across = {n: e for n, v in lines.items() if (e := finite(v)) is not None and e > 0}
    low, high = min([*errors, *across.values()]), max([*errors, *across.values()])
    logarithmic = low > 0 and high / low > WIDE
    start = 0.7 * low if logarithmic else 0.0
    for i, (name, kind, error) in enumerate(known):
        face, hatch = KINDS.get(kind, (style.BAR, ""))
        ax.barh(i, error - start, left=start, height=HEIGHT, fc=face, ec=style.INK, hatch=hatch, lw=0.7)
        text = f"{error:.3g}"
        if i and name != FLOOR:
            fall = errors[i - 1] - error
            text += f"  ({MINUS if fall >= 0 else '+'}{abs(fall):.2g})"
        ax.annotate(
            text, (error, i), xytext=(3, 0), textcoords="offset points", va="center", fontsize=8,
            bbox={"fc": "white", "ec": "none", "pad": 0.8}, zorder=5,
        )  # fmt: skip
    # Names of the lines stand one above the other: the lines may be close.
    for level, (name, error) in enumerate(sorted(across.items(), key=lambda item: -item[1])):
        ax.axvline(error, color=style.INK, lw=1.0, ls=LINES.get(name, "-"), zorder=0.5)
        ax.annotate(
            f"{name} {error:.3g}",
            (error, -0.6),
            xytext=(2, 2 + 10 * level),
            textcoords="offset points",
            ha="left",
            va="bottom",
            fontsize=8,
            annotation_clip=False,
        )
    if logarithmic:
        ax.set_xscale("log")
        ax.set_xlim(start, high * (high / start) ** 0.22)
    else:
        ax.set_xlim(0, 1.25 * high)
    ax.set_ylim(len(known) - 0.4, -0.6)
    ax.set_yticks(range(len(known)), [label(n.replace("_", " "), 30) for n, _, _ in known])
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(f"held-out error ({unit})" + (", logarithmic" if logarithmic else ""))
    handles = [Patch(fc=KINDS[k][0], ec=style.INK, hatch=KINDS[k][1], label=k, lw=0.7) for k in there]
    figure.legend(handles=handles, loc="outside lower center", fontsize=8, ncols=3)
    return figure
