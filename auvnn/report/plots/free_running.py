"""The plant's velocity and those of models that run free, as the paper's figures 5 to 9 draw them."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from auvnn.report import style
from auvnn.report.panels import NoData, time_series
from auvnn.report.plots.measured_against_model import rms_remarks
from auvnn.report.words import label


@style.styled
def free_running(
    t: ArrayLike, lines: Mapping[str, ArrayLike], *, mark: float | None = None, mark_words: str = ""
) -> Figure:
    """Draw six panels: the plant as a line, the models dashed, each panel with their rms errors in order.

    Args:
        t: s, (N,).
        lines: the plant first, then at most three models: name to velocity (N, 6).
        mark: a time to be marked, s.
        mark_words: what happens then.

    Raises:
        NoData: there is no plant, or no model.
    """
    if len(lines) < 2:
        raise NoData("there is no model to hold against the plant")
    plant, *models = lines
    remarks = rms_remarks(lines[plant], {name: lines[name] for name in models}, style.VELOCITY)
    figure = time_series(t, lines, remarks=remarks)
    if mark is not None:
        for i, ax in enumerate(figure.axes):
            ax.axvline(mark, color=style.FAINT, lw=0.8, ls=(0, (1, 1.5)), zorder=0.5)
            if i == 0:
                ax.annotate(
                    label(mark_words), (mark, 1.0), xycoords=("data", "axes fraction"), xytext=(2, -2),
                    textcoords="offset points", fontsize=7, va="top", color="#505050",
                    bbox={"fc": "white", "ec": "none", "alpha": 0.75, "pad": 0.6}, zorder=5,
                )  # fmt: skip
    return figure
