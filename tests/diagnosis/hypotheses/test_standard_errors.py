"""Standard errors against dense linear algebra, and what no sums can have told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.standard_errors import determined, is_possible, of_timing, standard_errors
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.effects import effect_class
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.vehicle import load_vehicle
from tests.diagnosis.linear_world import World, drawn, fitted, layout
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def world():
    return World.random(layout(), windows=60, strength=12.0, runs=4)


def test_standard_errors_are_those_of_the_dense_fit_and_grow_with_the_inflation(world):
    errors = drawn(world, 4)
    found, columns = fitted(world, errors, ["ocean_current"])
    j = world.jacobian.reshape(-1, world.jacobian.shape[-1])[:, columns]
    dense = np.linalg.inv(j.T @ j + np.diag(found.fitted.priors.precision))
    at = np.arange(len(columns))[-3:]
    std, factor = standard_errors(found, at)
    np.testing.assert_allclose(std, np.sqrt(np.diag(dense)[-3:] * factor), rtol=1e-6)
    assert 1.0 <= factor < 1.4
    loud, _ = fitted(world, 3 * errors, ["ocean_current"])
    std, factor = standard_errors(loud, at)
    assert factor == pytest.approx(9.0, rel=0.3)
    np.testing.assert_allclose(std, np.sqrt(np.diag(dense)[-3:] * factor), rtol=1e-6)


def test_what_the_log_says_nothing_about_has_no_standard_error(world):
    silent = World(world.layout, world.jacobian.copy(), world.run)
    silent.jacobian[..., silent.layout.columns["ocean_current"][2]] = 0.0
    found, columns = fitted(silent, drawn(silent, 5), ["ocean_current"])
    at = np.arange(len(columns))[-3:]
    np.testing.assert_array_equal(determined(found, at), [True, True, False])
    np.testing.assert_array_equal(np.isnan(standard_errors(found, at)[0]), [False, False, True])


def test_what_sums_cannot_have_told_is_not_possible():
    """The inverse of a regular matrix passes; a generalised one of a singular matrix and slopes that explode do not."""
    rng = np.random.default_rng(4)
    rows = rng.normal(size=(30, 4))
    square = rows.T @ rows
    value = np.array([1.0, -2.0, 0.0, 3.0])
    assert is_possible(np.diag(np.linalg.inv(square)), np.diag(square), value).all()
    alike = rows.copy()
    alike[:, 1] = alike[:, 0]
    square = alike.T @ alike
    told = is_possible(np.diag(np.linalg.pinv(square, hermitian=True)), np.diag(square), value)
    assert told.tolist() == [False, False, True, True]
    steep = np.diag([1e30, 1.0, 1.0, 0.0])
    told = is_possible(np.array([1e-30, 1.0, 1.0, 1.0]), np.diag(steep), value)
    assert told.tolist() == [False, True, True, False]


def test_a_fit_whose_slopes_explode_has_no_standard_errors(world):
    found, _ = fitted(world, drawn(world, 2, net_buoyancy=30.0), ["net_buoyancy"])
    at = found.names.index("net_buoyancy")
    columns = np.array([sum(len(world.layout.columns[n]) for n in found.names[:at])])
    assert np.isfinite(standard_errors(found, columns)[0]).all()
    sums = found.fitted.statistics
    hessian = sums.hessian.copy()
    hessian[3, columns[0]] *= 1e15
    hessian[3, :, columns[0]] *= 1e15
    blown = replace(found, fitted=replace(found.fitted, statistics=replace(sums, hessian=hessian)))
    assert np.isnan(standard_errors(blown, columns)[0]).all()


def test_delays_have_an_interval_in_their_standard_errors():
    """Commands that act up to an interval later than logged, evenly: its standard deviation, at any rate of the log."""
    model = GreyBox(small_vehicle())
    random = np.random.default_rng(3)
    for rate in (5.0, 20.0):
        windows = cut_windows(make_log(model, duration=12.0, rate=rate), 2.0)
        delayed = lay_out(model, ["net_buoyancy", "actuation_delay", "thruster_lag"])
        told = of_timing(delayed.model, ["net_buoyancy", "actuation_delay", "thruster_lag"], windows)
        drawn = random.uniform(0.0, 1.0 / rate, size=100000).std()
        assert told is not None and told.tolist() == pytest.approx([0.0, drawn, drawn], rel=0.01)
        assert of_timing(delayed.model, ["net_buoyancy"], windows) is None
        found = fit_hypothesis(delayed, windows, list(delayed.nuisance), ["actuation_delay"], iterations=1)
        at = delayed.places(found.names)["actuation_delay"]
        plain = replace(found, systematic=None)
        std = [standard_errors(e, at)[0][0] for e in (found, plain)]
        assert std[0] == pytest.approx(np.hypot(std[1], drawn), rel=0.01)


@pytest.mark.parametrize(
    ("effect", "parameter"),
    [("actuation_delay", "delay"), ("thruster_lag", "time_constant"), ("fin_lag", "time_constant")],
)
def test_all_effects_that_act_late_say_so(effect, parameter):
    described = {p.name: p for p in effect_class(effect).describe(load_vehicle("remus100"), "thrusters")}
    assert described[parameter].timing and described[parameter].unit == "s"


@pytest.mark.parametrize("stiffness", [0.0, 8.0])
def test_a_cable_that_is_never_taut_may_be_of_any_stiffness(stiffness):
    """The sums exclude a stiff cable with the slack that the fit happens to have, and say nothing of one with more."""
    plain = GreyBox(small_vehicle(0.0))
    hidden = {"stiffness": stiffness, "slack": 0.0, "weight": 1.5, "north": 3.0, "east": -2.0, "down": -4.0}
    log = make_log(plain.with_effects({"tether": hidden}), duration=40.0, noise=1.0)
    windows = cut_windows(log, 4.0)
    asked = lay_out(plain, ["velocity_scale", "tether"])
    start = {n: 0.9 * v for n, v in hidden.items() if n not in ("stiffness", "slack")}
    guess = replace(asked, model=plain.with_effects({"velocity_scale": {}, "tether": start}))
    found = fit_hypothesis(asked, windows, ["velocity_scale"], ["tether"], guess=guess)
    # Another effect's parameter comes first.
    assert found.names == ("velocity_scale", "tether")
    names = [p.name for p in found.fitted.model.effect("tether").parameters_of]
    told = dict(zip(names, standard_errors(found, 1 + np.arange(len(names)))[0], strict=True))
    value = dict(zip(names, found.fitted.theta[1:], strict=True))
    taut = stiffness > 0.0
    assert determined(found, np.array([0])).all()
    assert np.isfinite(told["weight"])
    assert np.isfinite(told["stiffness"]) == taut
    by_the_sums = np.sqrt(found.fitted.covariance()[1, 1])
    if taut:
        assert abs(value["stiffness"] - stiffness) < 4.0 * told["stiffness"]
    else:
        # By the sums alone it would be known to within a hundredth of the taut cable's, of which a slack one may be.
        assert by_the_sums < 0.01 * 8.0
