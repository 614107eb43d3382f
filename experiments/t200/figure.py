"""The figure of the bench study: what the force does beside what each explanation makes of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import run as study
from matplotlib.figure import Figure

from auvnn.report import style

SHOWN = (("static", style.BEFORE, "static"), ("thruster_lag", style.AFTER, "with lag"))
TRACE = (28, 0.25)  # window of the first record, and s of it


@style.styled
def figure(data: Path, result: dict) -> Figure:
    """Draw a stretch of fast sine, one edge of the squares, and how well each explanation does on records left out."""
    fig = style.new_figure(style.PAGE, 2.7)
    left, middle, right = fig.subplots(1, 3, width_ratios=(1.1, 1.1, 1.0))
    sine = study.windows([study.read(data, study.SINES[0])])
    square = study.windows([study.read(data, study.SQUARES[1])])
    for axes, batch, window, span, title in (
        (left, sine, TRACE[0], (0.0, TRACE[1]), "Sine, 10 Hz"),
        (middle, square, 5, (0.0, 0.6), "Square, about 2 Hz"),
    ):
        t = batch.times[window, batch.history :].numpy()
        part = (t >= span[0]) & (t <= span[1])
        look = style.MEASURED
        axes.plot(t[part], batch.force[window][part], color=look.color, lw=look.width, label="measured")
        for name, look, words in SHOWN:
            bench = study.Bench(data, study.CANDIDATES[name])
            bench.theta = np.array([p["value"] for p in result[name]["parameters"].values()])
            force = bench.predict(bench.theta, batch)[window][part]
            axes.plot(t[part], force, color=look.color, ls=look.dashes, lw=look.width, label=words)
        axes.set_xlabel("time (s)")
        axes.set_title(title)
    left.set_ylabel("force (N)")
    fig.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=3)
    names = list(study.CANDIDATES)
    values = [1.0 - result[n]["left_out_r2"] for n in names]
    right.barh(range(len(names)), values, color=style.BAR, edgecolor=style.INK, lw=0.5)
    for i, n in enumerate(names):
        each = [1.0 - x["r2"] for x in result[n]["left_out"]]
        right.plot(each, [i] * len(each), "o", ms=2.5, color=style.INK, clip_on=False)
    right.set_yticks(range(len(names)), [n.replace("_", " ") for n in names])
    right.invert_yaxis()
    right.set_xlim(0.0, 0.25)
    right.set_xlabel("share unexplained (1)")
    right.set_title("Sines left out")
    return fig


def draw(data: Path, result: dict, path: Path) -> None:
    """Write the figure as PNG."""
    path.write_bytes(style.png(figure(data, result), dpi=200))
