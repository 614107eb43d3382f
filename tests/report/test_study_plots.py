"""The plots and the page of a case study, from numbers made up here: no study is run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from auvnn.report.pages.study import PAGE
from auvnn.report.panels import NoData
from auvnn.report.plots.free_running import free_running
from auvnn.report.plots.frozen_ahead import frozen_ahead
from auvnn.report.plots.structures import structures

T = np.linspace(0, 30, 301)
PLANT = np.stack([np.tanh(T / (k + 1)) * 0.2 * (k + 1) for k in range(6)], 1)


def study() -> dict[str, Any]:
    rows = [
        {"structure": s, "trained_on": d, "parameters": n, "training_s": 1.0,
         "multisine_rmse_over_range_worst": e * f, "manoeuvre_rmse_over_range_worst": 2 * e}
        for d, f in (("rich", 1.0), ("manoeuvre", 30.0))
        for s, n, e in (("known", 0, 3.0), ("classical", 12, 0.17), ("parallel", 426, 0.004), ("damping", 426, 0.002))
    ]  # fmt: skip
    grid = np.linspace(-1, 1, 41)
    curve = {"nu": grid, "learned": grid * 3, "nominal": 2.8 * grid, "covered": (-0.5, 0.5)}
    drawn = [
        {"name": "figure_5", "kind": "velocity", "t": T, "title": "Figure 5", "caption": "c",
         "lines": {"plant": PLANT, "networks": PLANT * 1.001, "zero damping": PLANT * 9}, "mark": 5.0,
         "mark_words": "pick-up"},
        {"name": "damping", "kind": "damping", "curves": [curve] * 6, "title": "d", "caption": "c"},
        {"name": "frozen", "kind": "ahead", "ahead": 5.0, "title": "f", "caption": "c",
         "windows": {"offline": (T[:200], 0.3 + 0 * T[:200]), "follow": (T[:200], 0.1 + 0.01 * T[:200])}},
        {"name": "structures", "kind": "structures", "rows": rows, "title": "s", "caption": "c"},
    ]  # fmt: skip
    metrics = {
        "manoeuvre_rmse_over_range_worst": 3e-6, "manoeuvre_zero_damping_rmse_over_range_worst": 17.7,
        "manoeuvre_trained_held_out_multisine_rmse_over_range_worst": 0.6, "held_out_rmse_over_range_worst": 0.005,
        "parallel_over_six_held_out_rich": 0.5, "parallel_over_six_held_out_manoeuvre": 22.0,
    }  # fmt: skip
    return {"case": "noise_free", "name": "rov95", "options": {"seed": 0, "effort": "smoke"}, "metrics": metrics,
            "table": rows, "drawn": drawn, "assumed": ["ours: the vehicle is rov95"], "warnings": []}  # fmt: skip


def test_the_page_holds_all_figures_and_says_that_it_is_a_smoke_run():
    html = PAGE.page(study())
    assert (
        html.count("<svg") == 4 and "could not be drawn" not in html and "There is no figure here" not in html
    )
    assert "A smoke run" in html and "The vehicle is rov95" in html
    assert "17.7" in html or "18 times" in html


def test_free_running_draws_the_plant_in_full_and_marks_the_time():
    figure = free_running(T, {"plant": PLANT, "networks": PLANT * 1.5}, mark=5.0, mark_words="pick-up")
    assert len(figure.axes) == 6
    for i, ax in enumerate(figure.axes):
        plant, model, mark = ax.lines[0], ax.lines[1], ax.lines[-1]
        order = i // 2 + 3 * (i % 2)
        np.testing.assert_allclose(plant.get_ydata()[-1], PLANT[-1, order])
        np.testing.assert_allclose(model.get_ydata()[-1], 1.5 * PLANT[-1, order])
        assert set(mark.get_xdata()) == {5.0}
    assert "pick-up" in [t.get_text() for t in figure.axes[0].texts]


def test_frozen_ahead_draws_percent_on_a_log_axis():
    figure = frozen_ahead({"offline": (T[:3], [0.3, 0.2, 0.0])}, ahead=5.0)
    (line,) = figure.axes[0].lines
    np.testing.assert_allclose(line.get_ydata()[:2], [30, 20])
    assert figure.axes[0].get_yscale() == "log" and np.isnan(line.get_ydata()[2])


def test_structures_have_a_row_each_and_a_marker_for_each_training():
    figure = structures(study()["table"], {"multisine_rmse_over_range_worst": "held out"})
    (ax,) = figure.axes
    assert ax.get_yticklabels()[0].get_text().startswith("known")
    rich, manoeuvre = ax.lines
    np.testing.assert_allclose(rich.get_xdata(), [300, 17, 0.4, 0.2])
    np.testing.assert_allclose(np.asarray(manoeuvre.get_xdata()) / rich.get_xdata(), 30)


@pytest.mark.parametrize("draw", [lambda: free_running(T, {"plant": PLANT}), lambda: frozen_ahead({}, ahead=5.0),
                                  lambda: structures([], {"e": "x"})])  # fmt: skip
def test_nothing_to_draw_is_told(draw):
    with pytest.raises(NoData):
        draw()
