"""Plots over time and horizon: measured and modelled velocity, and the error of free running."""

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from auvnn.report import style
from auvnn.report.plots.error_against_horizon import error_against_horizon
from auvnn.report.plots.error_over_time import error_over_time
from auvnn.report.plots.measured_against_model import measured_against_model
from auvnn.report.plots.residual_over_time import residual_over_time
from tests.report.fake_signals import AXES, CHANNELS
from tests.report.plot_samples import DRAWN, MODEL, NU, T, lines


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
