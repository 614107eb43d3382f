"""Plots of what was found: residual map, ranking, waterfall, parameters, quality and training."""

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer

from auvnn.report import style
from auvnn.report.plots.damping_curves import damping_curves
from auvnn.report.plots.excitation import excitation
from auvnn.report.plots.history import history
from auvnn.report.plots.kinematics import kinematics
from auvnn.report.plots.parameters import parameters
from auvnn.report.plots.ranking import brackets, ranking
from auvnn.report.plots.residual_map import residual_map
from auvnn.report.plots.similarity import similarity
from auvnn.report.plots.timeline import timeline
from auvnn.report.plots.waterfall import waterfall
from tests.report.fake_signals import AXES, regimes
from tests.report.plot_samples import CURVE, FITTED, NU, RUN, STEPS, bars, words
from tests.report.report_fakes import candidates


def test_the_map_shows_residual_over_noise_floor_in_every_cell():
    data, floor = regimes(), np.array([2, 2, 2, 0.3, 0.3, 0.3])
    figure = residual_map(data, floor)
    panels = {
        ax.get_xlabel().split(" (")[0]: ax for ax in figure.axes if ax.get_xlabel().split(" (")[0] in data
    }
    assert set(panels) == set(data)
    for name, ax in panels.items():
        expected = data[name]["rms"] / floor[:, None]
        shown = ax.collections[0].get_array().reshape(expected.shape)
        np.testing.assert_allclose(np.ma.filled(shown, np.nan), expected)
        assert len(ax.texts) == np.isfinite(expected).sum()
    heading = panels["heading"]
    worst = data["heading"]["rms"] / floor[:, None]
    i, j = np.unravel_index(np.argmax(worst), worst.shape)
    text = next(t for t in heading.texts if t.get_position() == (j + 0.5, i + 0.5))
    assert float(text.get_text()) == pytest.approx(worst[i, j], rel=0.06)
    # An empty bin is hatched, not coloured.
    assert len([p for p in panels["depth"].patches if p.get_hatch()]) == 6
    assert "(m)" in panels["depth"].get_xlabel()


def test_the_map_brightens_steadily_with_the_residual():
    grey = mpl.colormaps["cividis"](np.linspace(0, 1, 64))[:, :3] @ (0.299, 0.587, 0.114)
    assert (np.diff(grey) > 0).all()


def test_few_samples_are_bracketed():
    data = {"speed": {"edges": [0, 1, 2], "unit": "m/s", "rms": np.full((6, 2), 4.0), "count": [5, 500]}}
    ax = residual_map(data, np.ones(6)).axes[0]
    assert sorted({t.get_text() for t in ax.texts}) == ["(4.0)", "4.0"]


def test_without_noise_floor_rows_are_relative_to_themselves():
    rms = np.array([[1.0, 3.0]] * 6)
    ax = residual_map(
        {"speed": {"edges": [0, 1, 2], "unit": "m/s", "rms": rms, "count": [50, 50]}}, None
    ).axes[0]
    np.testing.assert_allclose(ax.collections[0].get_array().ravel()[:2], [1 / 5**0.5, 3 / 5**0.5])


def test_the_ranking_shows_shares_gains_and_p():
    cands = candidates()
    left, right = ranking(cands, ["ocean_current"]).axes
    tried = [c for c in cands if not c["needs"]]
    drawn = sorted(bars(left), key=lambda p: p.get_y())
    np.testing.assert_allclose([p.get_width() for p in drawn], [100 * c["explained"] for c in tried])
    assert [bool(p.get_hatch()) for p in drawn] == [True] + [False] * 9
    errorbars = [c for c in right.containers if isinstance(c, ErrorbarContainer)]
    np.testing.assert_allclose(
        [e.lines[0].get_xdata()[0] for e in errorbars],
        [100 * (c["cv_before"] - c["cv_after"]) for c in tried],
    )
    half = [np.ptp(e.lines[2][0].get_segments()[0][:, 0]) / 2 for e in errorbars]
    np.testing.assert_allclose(half, [196 * c["cv_std"] for c in tried])
    assert "1 × 10⁻³⁰" in words(right) and "alike" in words(right)
    assert "no altitude" in words(left)
    bold = [t.get_text() for t in left.get_yticklabels() if t.get_fontweight() == "bold"]
    assert bold == ["ocean_current"]


def test_brackets_join_what_is_confusable_once():
    group = [
        {"effect": "a", "explained": 0.5, "confusable_with": [{"effect": "c"}, {"effect": "elsewhere"}]},
        {"effect": "b", "confusable_with": []},
        {"effect": "c", "confusable_with": [{"effect": "a"}]},
        {"effect": "d"},
    ]
    assert brackets(group) == [["a", "c"]]
    # What explains next to nothing needs no bracket, unless it was chosen.
    group[0]["explained"], group[3]["explained"] = 0.01, 0.9
    assert brackets(group) == [] and brackets(group, ["a"]) == [["a", "c"]]


def test_similarities_are_shown_once_and_alike_pairs_are_framed():
    table = np.array([[1, 0.95, 0.2], [0.95, 1, -0.4], [0.2, -0.4, 1]])
    ax = similarity(["a", "b", "c"], table).axes[0]
    assert sorted(t.get_text() for t in ax.texts) == [".20", ".40", ".95"]
    frames = [p for p in ax.patches if not p.get_fill()]
    assert len(frames) == 1
    assert [t.get_text() for t in ax.get_yticklabels()] == ["a", "b", "c"]


def test_the_waterfall_falls_by_the_numbers():
    ax = waterfall(STEPS).axes[0]
    full = [p for p in bars(ax) if p.get_y() == 0]
    np.testing.assert_allclose([p.get_height() for p in full], [0.4, 0.3, 0.1, 0.08])
    falls = [p for p in bars(ax) if p.get_y() > 0]
    np.testing.assert_allclose([p.get_height() for p in falls], [0.1, 0.2])
    np.testing.assert_allclose([p.get_y() for p in falls], [0.3, 0.1])
    assert all(p.get_hatch() for p in falls)
    text = words(ax)
    for number in ("0.400", "0.300", "0.100", "0.080", "\N{MINUS SIGN}0.100", "\N{MINUS SIGN}0.200"):
        assert number in text
    assert any(list(line.get_ydata()) == [0.08, 0.08] for line in ax.lines)


def test_a_step_that_harms_rises_and_looks_different():
    ax = waterfall([{"step": "as given", "error": 0.2}, {"step": "wrong", "error": 0.25}]).axes[0]
    rise = next(p for p in bars(ax) if p.get_y() > 0)
    assert rise.get_height() == pytest.approx(0.05)
    assert rise.get_hatch() == style.BEFORE.hatch != style.AFTER.hatch
    assert "+0.050" in words(ax)


def test_parameters_have_95_percent_intervals_and_an_axis_per_unit():
    figure = parameters(FITTED, {"ocean_current": {"v_north": 0.19}})
    assert [ax.get_xlabel() for ax in figure.axes] == ["value (m/s)", "value (s)"]
    current, lag = figure.axes
    interval = current.containers[0].lines[2][0].get_segments()[0]
    np.testing.assert_allclose(interval[:, 0], [0.2 - 1.96 * 0.01, 0.2 + 1.96 * 0.01])
    assert any(list(line.get_xdata()) == [0.19] for line in current.lines)
    assert "0.200 ± 0.010" in words(current)
    assert lag.containers[0].lines[2] == () or not lag.containers[0].has_xerr


def test_the_timeline_counts_missing_samples_and_gaps():
    t = np.concatenate([np.arange(0, 50, 0.1), np.arange(80, 130, 0.1)])
    y = np.ones(t.size)
    y[:250] = np.nan
    figure = timeline([{"run": 1, "t": t, "channels": {"u": y, "v": np.ones(t.size)}}])
    ax = figure.axes[0]
    shown = ax.collections[0].get_array().reshape(2, -1)
    edges = np.linspace(0, t[-1], shown.shape[1] + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    assert set(shown[0, middle < 24]) == {3}
    assert set(shown[0, (middle > 26) & (middle < 49)]) == {1}
    assert set(shown[:, (middle > 51) & (middle < 79)].ravel()) == {0}
    assert set(shown[1, middle > 81]) == {1}
    marks = [line for line in ax.lines if line.get_marker() == "v" and len(line.get_xdata())]
    assert len(marks) == 1 and marks[0].get_xdata()[0] == pytest.approx(65.0, abs=0.2)


def test_runs_stand_one_after_the_other():
    figure = timeline([RUN, {**RUN, "run": 2, "channels": {"u": NU[:, 0]}}])
    first, second = figure.axes[0].collections
    assert second.get_coordinates()[0, 0, 0] > first.get_coordinates()[0, -1, 0]
    # The second run has no voltage: all of its row is missing.
    assert set(second.get_array().reshape(2, -1)[1]) == {3}


def test_a_reversed_axis_points_left_and_is_hatched():
    checks = [
        {"channel": "p", "slope": -0.97, "correlation": 0.98},
        {"channel": "r", "slope": 1.02, "correlation": 0.99},
    ]
    ax = kinematics(checks).axes[0]
    p, r = sorted(bars(ax), key=lambda b: b.get_y())
    assert p.get_width() == pytest.approx(-0.97) and p.get_hatch()
    assert r.get_width() == pytest.approx(1.02) and not r.get_hatch()
    assert "\N{MINUS SIGN}0.97" in words(ax)


def test_excitation_is_spread_over_noise():
    channels = [
        {"channel": "u", "std": 0.3, "noise": 0.006, "unit": "m/s"},
        {"channel": "p", "std": 0.005, "noise": 0.003, "unit": "rad/s"},
        {"channel": "w", "std": None, "noise": 0.0, "unit": "m/s"},
    ]
    ax = excitation(channels).axes[0]
    u, p = sorted(bars(ax), key=lambda b: b.get_y())
    assert u.get_x() + u.get_width() == pytest.approx(50.0) and not u.get_hatch()
    assert p.get_x() + p.get_width() == pytest.approx(0.005 / 0.003) and p.get_hatch()


def test_the_best_held_out_step_is_marked():
    ax = history([1, 0.5, 0.3, 0.2], [1.1, 0.7, 0.6, 0.8]).axes[0]
    best = next(line for line in ax.lines if line.get_marker() == "o")
    assert (best.get_xdata()[0], best.get_ydata()[0]) == (2, 0.6)
    assert ax.get_yscale() == "linear"
    assert history([1.0, 0.01]).axes[0].get_yscale() == "log"
    assert history([1.0, 0.0]).axes[0].get_yscale() == "linear"


def test_damping_curves_shade_what_the_data_cover():
    figure = damping_curves([CURVE] * 5 + [{}])
    by_label = {ax.get_ylabel(): ax for ax in figure.axes}
    assert set(by_label) == {f"$d_{a}$ ({'N' if i < 3 else 'N m'})" for i, a in enumerate(AXES)}
    ax = by_label["$d_X$ (N)"]
    np.testing.assert_allclose([ax.patches[0].get_x(), ax.patches[0].get_width()], [-0.5, 0.9])
    assert any(np.array_equal(line.get_ydata(), CURVE["learned"]) for line in ax.lines)
    assert "nothing learned" in words(by_label["$d_N$ (N m)"])
