import subprocess
import sys
import xml.etree.ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.container import BarContainer, ErrorbarContainer
from matplotlib.figure import Figure

from auvnn.report import style
from auvnn.report.panels import NoData
from auvnn.report.plots.before_after import before_after
from auvnn.report.plots.damping_curves import damping_curves
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.plots.error_over_time import error_over_time
from auvnn.report.plots.excitation import excitation
from auvnn.report.plots.history import history
from auvnn.report.plots.kinematics import kinematics
from auvnn.report.plots.measured_against_model import measured_against_model
from auvnn.report.plots.parameters import parameters
from auvnn.report.plots.ranking import brackets, ranking
from auvnn.report.plots.residual_map import residual_map
from auvnn.report.plots.residual_over_time import residual_over_time
from auvnn.report.plots.similarity import similarity
from auvnn.report.plots.timeline import timeline
from auvnn.report.plots.waterfall import waterfall
from tests.report.report_fakes import (
    AXES,
    CHANNELS,
    NAMES,
    candidates,
    drift,
    motion,
    regimes,
    similarity_table,
    times,
)

T = times(1000)
NU = motion(T)
MODEL = NU + drift(T, 1.0)
STEPS = [
    {"step": "as given", "error": 0.4},
    {"step": "coefficients refitted", "error": 0.3},
    {"step": "ocean_current", "error": 0.1},
    {"step": "noise floor", "error": 0.08},
]
FITTED = {
    "ocean_current": {"v_north": {"value": 0.2, "std": 0.01, "unit": "m/s"}},
    "thruster_lag": {"time_constant": {"value": 0.3, "std": None, "unit": "s"}},
}
RUN = {"run": 1, "t": T, "channels": {"u": NU[:, 0], "voltage": np.where(T > 25, np.nan, 15.0)}}
CURVE = {
    "nu": np.linspace(-1, 1, 50),
    "learned": np.linspace(-9, 9, 50),
    "nominal": np.zeros(50),
    "covered": (-0.5, 0.4),
}
HORIZONS = {"1": 0.2, "5": 0.5, "full": 0.9}
DRAWN = {
    "measured_against_model": lambda: measured_against_model(T, NU, MODEL),
    "before_after": lambda: before_after(T, NU, MODEL, NU + drift(T, 0.1), NU + drift(T, 0.5)),
    "error_over_time": lambda: error_over_time(T, NU, {"as given": MODEL, "after": NU + drift(T, 0.1)}),
    "residual_over_time": lambda: residual_over_time(T, NU, np.full(6, 0.1)),
    "error_against_horizon": lambda: error_against_horizon({"as given": HORIZONS}, {"1": 0.4, "5": 1.2}),
    "residual_map": lambda: residual_map(regimes(), [2, 2, 2, 0.3, 0.3, 0.3]),
    "ranking": lambda: ranking(candidates(), ["ocean_current"]),
    "similarity": lambda: similarity(NAMES, similarity_table()),
    "waterfall": lambda: waterfall(STEPS),
    "parameters": lambda: parameters(FITTED, {"ocean_current": {"v_north": 0.19}}),
    "timeline": lambda: timeline([RUN]),
    "kinematics": lambda: kinematics([{"channel": "p", "slope": -0.97, "correlation": 0.98}]),
    "excitation": lambda: excitation([{"channel": "u", "std": 0.3, "noise": 0.006, "unit": "m/s"}]),
    "history": lambda: history([1, 0.5, 0.3], [1.1, 0.7, 0.8]),
    "damping_curves": lambda: damping_curves([CURVE] * 6),
}  # fmt: skip


def lines(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 4]


def bars(ax):
    return [patch for c in ax.containers if isinstance(c, BarContainer) for patch in c.patches]


def words(ax):
    return " ".join(t.get_text() for t in ax.texts)


@pytest.mark.parametrize("name", DRAWN)
def test_every_plot_is_a_figure_whose_axes_say_quantity_and_unit(name):
    figure = DRAWN[name]()
    assert isinstance(figure, Figure)
    drawn = [ax for ax in figure.axes if ax.axison and (ax.lines or ax.patches or ax.collections)]
    assert drawn
    labels = [ax.get_xlabel() for ax in drawn] + [ax.get_ylabel() for ax in drawn]
    assert any(labels)
    for label in filter(None, labels):
        unit = any(
            f"({u}" in label
            for u in ("m/s", "rad/s", "N", "s)", "m)", "rad)", "%", "V", "nrmse", "dimensionless")
        )
        ratio = any(w in label for w in ("/", "slope", "similarity", "command", "horizon", "step", "epoch"))
        assert unit or ratio, f"{name}: '{label}' has no unit"
    sizes = {t.get_fontsize() for ax in drawn for t in (ax.xaxis.label, ax.yaxis.label)}
    assert sizes == {9.0}


@pytest.mark.parametrize("name", DRAWN)
def test_equal_data_give_equal_files_whatever_the_users_settings(name):
    # Laid out once, as pages do; `test_png_files_are_equal_too_and_as_fine_as_asked` leaves that to the drawing.
    plain = style.svg(style.settle(DRAWN[name]()))
    with mpl.rc_context({"font.size": 20, "axes.grid": True, "lines.linewidth": 7, "svg.fonttype": "none"}):
        before = dict(mpl.rcParams)
        assert style.svg(style.settle(DRAWN[name]())) == plain
        assert dict(mpl.rcParams) == before


def test_png_files_are_equal_too_and_as_fine_as_asked():
    first, second = (style.png(DRAWN["waterfall"](), dpi=60) for _ in range(2))
    assert first == second and first[:8] == b"\x89PNG\r\n\x1a\n"
    figure = DRAWN["waterfall"]()
    width = int.from_bytes(style.png(figure, dpi=100)[16:20], "big")
    assert width == pytest.approx(100 * figure.get_figwidth(), abs=1)


def test_six_panels_with_measurement_and_model():
    figure = measured_against_model(T, NU, MODEL, title="run 3")
    assert len(figure.axes) == 6
    units = ["m/s"] * 3 + ["rad/s"] * 3
    by_label = {ax.get_ylabel(): ax for ax in figure.axes}
    for i, (channel, unit) in enumerate(zip(CHANNELS, units, strict=True)):
        measured, model = lines(by_label[f"${channel}$ ({unit})"])
        np.testing.assert_array_equal(measured.get_ydata(), NU[:, i])
        np.testing.assert_array_equal(model.get_ydata(), MODEL[:, i])
        assert measured.get_linestyle() == "-" and model.get_linestyle() != "-"
        rms = float(np.sqrt(np.mean((MODEL[:, i] - NU[:, i]) ** 2)))
        assert f"{rms:.2g}" in by_label[f"${channel}$ ({unit})"].get_title("right")
    assert [t.get_text() for t in figure.legends[0].get_texts()] == ["measured", "model"]


@pytest.mark.parametrize(
    ("symbols", "label"), [(style.WRENCH, "$K$ (N m)"), (style.ACCELERATION, r"$\dot{u}$ (m/s²)")]
)
def test_other_quantities_carry_their_own_symbols(symbols, label):
    figure = measured_against_model(T, NU, MODEL, symbols=symbols)
    assert label in [ax.get_ylabel() for ax in figure.axes]


def test_long_records_are_thinned_but_keep_their_peaks():
    n = 300_000
    y = np.zeros((n, 6))
    y[123_456, 2] = 7.0
    figure = measured_against_model(np.arange(n) * 0.05, y, y + 0.1, limit=1000)
    for ax in figure.axes:
        assert all(len(line.get_xdata()) <= 1000 for line in lines(ax))
    peak = next(ax for ax in figure.axes if ax.get_ylabel().startswith("$w$"))
    assert lines(peak)[0].get_ydata().max() == 7.0


def test_a_diverged_model_does_not_flatten_the_measurement():
    model = MODEL.copy()
    model[500:, 1] = np.exp(np.arange(500) / 10)
    figure = measured_against_model(T, NU, model)
    ax = next(a for a in figure.axes if a.get_ylabel().startswith("$v$"))
    assert np.ptp(ax.get_ylim()) < 5 * np.ptp(NU[:, 1])
    assert "leaves the panel" in ax.get_title("left")
    other = next(a for a in figure.axes if a.get_ylabel().startswith("$u$"))
    assert other.get_title("left") == ""


def test_before_and_after_are_told_apart_in_grey_and_without_colour():
    ax = DRAWN["before_after"]().axes[0]
    drawn = lines(ax)
    assert len(drawn) == 4
    grey = sorted(float(np.dot(to_rgb(line.get_color()), (0.299, 0.587, 0.114))) for line in drawn)
    assert min(np.diff(grey)) > 0.1
    assert len({str(line.get_linestyle()) + str(line._dash_pattern) for line in drawn}) == 4
    markers = {
        look.marker for look in (style.MEASURED, style.AFTER, style.BEFORE, style.REFITTED, style.PERSISTENCE)
    }
    assert len(markers) == 5


def test_errors_over_time_are_model_minus_measurement():
    figure = error_over_time(T, NU, {"as given": MODEL})
    ax = next(a for a in figure.axes if a.get_ylabel() == r"$\Delta v$ (m/s)")
    np.testing.assert_allclose(lines(ax)[0].get_ydata(), MODEL[:, 1] - NU[:, 1])


def test_the_noise_band_is_two_standard_deviations():
    figure = residual_over_time(T, NU, [1, 2, 3, 4, 5, 6])
    for i, axis in enumerate(AXES):
        ax = next(a for a in figure.axes if a.get_ylabel().startswith(f"${axis}$"))
        band = ax.patches[0].get_extents().transformed(ax.transData.inverted())
        assert band.y0 == pytest.approx(-2.0 * (i + 1)) and band.y1 == pytest.approx(2.0 * (i + 1))


def test_horizons_are_logarithmic_and_the_whole_run_stands_apart():
    errors = {"0.5": 0.1, "1": 0.2, "5": 0.5, "full": 0.9, "2": None}
    figure = error_against_horizon({"as given": errors, "after": {"1": 0.1}}, {"0.5": 0.3, "5": 1.4})
    ax = figure.axes[0]
    assert ax.get_xscale() == "log"
    by_label = {line.get_label(): line for line in ax.lines}
    assert list(by_label["as given"].get_xdata()) == [0.5, 1.0, 5.0]
    assert list(by_label["as given"].get_ydata()) == [0.1, 0.2, 0.5]
    assert list(by_label["initial velocity held"].get_ydata()) == [0.3, 1.4]
    alone = [line for line in ax.lines if list(line.get_ydata()) == [0.9]]
    assert len(alone) == 1 and alone[0].get_xdata()[0] > 5.0
    assert ax.get_ylim()[0] == 0.0 and ax.get_ylim()[1] >= 1.4


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


NOTHING = {
    "measured_against_model": lambda: measured_against_model([], np.zeros((0, 6)), np.zeros((0, 6))),
    "all missing": lambda: measured_against_model(T, np.full((1000, 6), np.nan), np.full((1000, 6), np.nan)),
    "wrong shape": lambda: before_after(T, NU[:, :3], MODEL[:, :3], MODEL[:, :3]),
    "residual_over_time": lambda: residual_over_time(T, np.full((1000, 6), np.nan)),
    "error_against_horizon": lambda: error_against_horizon({"as given": {"1": None}}, {}),
    "residual_map": lambda: residual_map({}, np.ones(6)),
    "residual_map, empty bins": lambda: residual_map(
        {"speed": {"rms": np.ones((6, 1)), "count": [0]}}, np.ones(6)
    ),
    "ranking": lambda: ranking([{"effect": "a", "needs": ["z"]}]),
    "similarity": lambda: similarity(["a"], [[1.0]]),
    "waterfall": lambda: waterfall([{"step": "as given", "error": None}]),
    "parameters": lambda: parameters({"a": {"b": {"value": float("nan")}}}),
    "timeline": lambda: timeline([{"run": 1, "t": [0.0], "channels": {"u": [1.0]}}]),
    "kinematics": lambda: kinematics([{"channel": "u", "slope": float("nan")}]),
    "excitation": lambda: excitation([{"channel": "u", "std": 1.0, "noise": 0.0}]),
    "history": lambda: history([float("nan")]),
    "damping_curves": lambda: damping_curves([{}] * 6),
}


@pytest.mark.parametrize("name", NOTHING)
def test_nothing_to_draw_is_said_in_words(name):
    with pytest.raises(NoData) as problem:
        NOTHING[name]()
    assert len(str(problem.value)) > 10


ODD = {
    "one sample": lambda: measured_against_model([0.0, 1.0], np.zeros((2, 6)), np.full((2, 6), np.nan)),
    "constant": lambda: before_after(T, np.zeros((1000, 6)), np.zeros((1000, 6)), np.zeros((1000, 6))),
    "huge": lambda: measured_against_model(T, NU * 1e30, MODEL * 1e30),
    "infinite": lambda: measured_against_model(T, NU, np.where(T[:, None] > 20, np.inf, MODEL)),
    "overflowing": lambda: error_over_time(T, NU, {"after": np.where(T[:, None] > 20, -1e308, MODEL)}),
    "one candidate": lambda: ranking([{"effect": "a"}]),
    "no gain": lambda: ranking([{"effect": "a", "explained": 0.0, "cv_before": 0.0, "cv_after": 0.0}], ["a"]),
    "many candidates": lambda: ranking([{"effect": f"e{i}", "explained": 0.5} for i in range(200)]),
    "one regime": lambda: residual_map(
        {"x": {"rms": np.full((6, 1), 1e-9), "count": [1], "edges": [0, 0]}}, np.ones(6)
    ),
    "many bins": lambda: residual_map({"x": {"rms": np.ones((6, 40)), "edges": np.arange(41)}}, np.ones(6)),
    "zero error": lambda: waterfall([{"step": "a", "error": 0.0}, {"step": "b", "error": 0.0}]),
    "zero std": lambda: parameters({"a": {"b": {"value": 0.0, "std": 0.0, "unit": None}}}),
    "many runs": lambda: timeline([{**RUN, "run": i} for i in range(60)]),
    "huge slope": lambda: kinematics([{"channel": "p", "slope": 57.3, "correlation": None}]),
    "many similar": lambda: similarity([f"e{i}" for i in range(40)], np.ones((40, 40))),
    "nan similar": lambda: similarity(["a", "b"], [[1, np.nan], [np.nan, 1]]),
}


@pytest.mark.parametrize("name", ODD)
@pytest.mark.filterwarnings("error")
def test_odd_data_are_drawn_without_complaint(name):
    figure = ODD[name]()
    assert len(style.svg(style.settle(figure))) > 1000
    assert figure.get_figwidth() <= style.PAGE + 1e-9
    assert figure.get_figheight() < 12


@pytest.mark.parametrize(
    "name", ["$x_{ \\frac{1}{0}$$", "_hidden" + "a" * 500, "\x1b[0m\ud800\u202e船 <b>&amp;"]
)
@pytest.mark.filterwarnings("error")
def test_hostile_names_are_drawn_as_text(name):
    cands = [{**c, "effect": name} for c in candidates()[:2]]
    for figure in (
        ranking(cands, [name]),
        similarity([name, name], np.ones((2, 2))),
        waterfall([{"step": name, "error": 1.0}, {"step": name, "error": 0.5}]),
        parameters({name: {name: {"value": 1.0, "std": 0.1, "unit": name}}}),
        residual_map({name: {"rms": np.ones((6, 1)), "unit": name, "edges": [0, 1]}}, np.ones(6)),
        measured_against_model(T, NU, MODEL, title=name),
        error_against_horizon({name: {"1": 0.5}}),
        timeline([{"run": name, "t": T, "channels": {name: NU[:, 0]}}] * 2),
        kinematics([{"channel": name, "slope": 1.0}]),
        excitation([{"channel": name, "std": 1.0, "noise": 0.1, "unit": name}]),
        history([1.0, 0.5], step=name, error=name),
    ):
        text = style.svg(style.settle(figure))
        tags = {element.tag.rpartition("}")[2] for element in ET.fromstring(text).iter()}
        assert "b" not in tags and "path" in tags
        assert "\x1b" not in text and "\u202e" not in text
        text.encode("utf-8")
        assert figure.get_figwidth() <= style.PAGE + 1e-9


def test_a_notebook_shows_the_figure_without_pyplot():
    assert waterfall(STEPS)._repr_png_()[:4] == b"\x89PNG"


def test_drawing_never_touches_pyplot():
    code = (
        "import sys; sys.path.insert(0, 'tests/report'); import numpy as np;"
        "from auvnn.report.plots.waterfall import waterfall; from auvnn.report import style;"
        "f = waterfall([{'step': 'a', 'error': 1}, {'step': 'b', 'error': 0.5}]); style.png(f); style.svg(f);"
        "from auvnn.report.pages.demo import PAGE; PAGE.page({});"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
