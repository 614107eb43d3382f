"""The plots of an online adaptation, from numbers made up here."""

from __future__ import annotations

import numpy as np

from auvnn.report import style
from auvnn.report.plots.adaptation import with_and_without


def test_runs_are_parted_and_samples_that_fit_exactly_do_not_stretch_the_axis():
    t = np.arange(20.0)
    without = np.full((20, 6), 1e-2)
    without[10:] = 1e-17
    figure = with_and_without(t, np.full((20, 6), 1e-3), without, names=style.VELOCITY, lengths=[10, 10])
    ax = figure.axes[0]
    drawn = [line for line in ax.lines if len(line.get_xdata()) > 2]
    assert [(line.get_xdata()[0], line.get_xdata()[-1]) for line in drawn] == [(0, 9), (10, 19)] * 2
    assert [line.get_xdata()[0] for line in ax.lines if len(line.get_xdata()) == 2] == [10.0]
    assert ax.get_yscale() == "log" and 1e-8 < ax.get_ylim()[0] < 1.1e-7
    assert len(figure.legends[0].get_texts()) == 2
