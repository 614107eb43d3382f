"""The figure of the glider's study: depth and depth rate of dives that nothing was fitted to."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import run as study
from matplotlib.figure import Figure

from auvnn.logs import Log
from auvnn.report import style

SHOWN = 4  # dives and climbs


@style.styled
def figure(log: Log, predicted: dict[str, np.ndarray]) -> Figure:
    """Draw depth and depth rate of the first dives of the second half, and the predicted against the measured rate."""
    fig = style.new_figure(style.PAGE, 3.0)
    left, right = fig.subplots(1, 2, width_ratios=(1.7, 1.0))
    look, model = style.MEASURED, style.AFTER
    begin = log.runs[0].t[0]
    for k, run in enumerate(log.runs[:SHOWN]):
        t = (run.t - begin) / 60.0
        own = {"label": "measured"} if not k else {}
        left.plot(t, study.depth_rate(run), color=look.color, lw=look.width, **own)
        own = {"label": "predicted"} if not k else {}
        left.plot(t, predicted[f"rate_{run.number}"], color=model.color, ls=model.dashes, lw=1.4, **own)
    left.axhline(0.0, color=style.FAINT, lw=0.5)
    left.set_xlabel("time (min)")
    left.set_ylabel("depth rate (m/s)")
    left.set_title("Dives and climbs of the second half")
    fig.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    measured = np.concatenate([study.depth_rate(run) for run in log.runs])
    rate = np.concatenate([predicted[f"rate_{run.number}"] for run in log.runs])
    right.plot(measured, rate, ".", ms=1.5, color=look.color, alpha=0.3)
    ends = [-0.25, 0.25]
    right.plot(ends, ends, color=model.color, lw=1.0)
    right.set_xlim(*ends)
    right.set_ylim(*ends)
    right.set_xlabel("measured (m/s)")
    right.set_ylabel("predicted (m/s)")
    right.set_title("All of the second half")
    return fig


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit("python experiments/glider/figure.py DATA OUT [PNG]: OUT is what run.py has written")
    data, out = Path(sys.argv[1]), Path(sys.argv[2])
    second = study.halves(data, out)[1]
    values = dict(np.load(out / "predicted.npz"))
    path = Path(sys.argv[3] if len(sys.argv) > 3 else Path(__file__).parent / "glider.png")
    path.write_bytes(style.png(figure(second, values), dpi=200))
