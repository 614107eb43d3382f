"""What holds for every plot: axes say quantity and unit, equal data give equal files, odd data are survived."""

import subprocess
import sys
import xml.etree.ElementTree as ET

import matplotlib as mpl
import numpy as np
import pytest
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
from auvnn.report.plots.ranking import ranking
from auvnn.report.plots.residual_map import residual_map
from auvnn.report.plots.residual_over_time import residual_over_time
from auvnn.report.plots.similarity import similarity
from auvnn.report.plots.timeline import timeline
from auvnn.report.plots.waterfall import waterfall
from tests.report.plot_samples import DRAWN, MODEL, NU, RUN, STEPS, T
from tests.report.report_fakes import candidates


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
