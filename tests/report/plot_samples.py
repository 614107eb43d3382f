"""One figure of every kind, of made-up data, and what is asked of all of them."""

import numpy as np
from matplotlib.container import BarContainer

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
from tests.report.fake_signals import drift, motion, regimes, times
from tests.report.report_fakes import NAMES, candidates, similarity_table

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
