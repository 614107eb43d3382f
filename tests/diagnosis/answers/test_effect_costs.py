"""What names cost and exert, against forces known from the equations; what a tolerance leaves out."""

from __future__ import annotations

import json

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers.moved_coefficients import moved_words
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NAMES = ["net_buoyancy", "constant_force"]


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def found_in(model, truth, tolerance=None, **options):
    log = make_log(model.with_effects(truth), runs=4, duration=12.0, noise=1.0, seed=4)
    return diagnose(model, log, NAMES, advice=False, whiteness=False, tolerance=tolerance, **options)


@pytest.fixture(scope="module")
def two(model):
    return found_in(model, {"net_buoyancy": {"force": 8.0}, "constant_force": {"X": 5.0}})


def test_each_force_is_the_one_that_was_hidden(two):
    assert set(two.missing) == set(NAMES)
    pushed, lifted = two.matters["constant_force"], two.matters["net_buoyancy"]
    assert pushed["force"]["X"] == pytest.approx(5.0, rel=0.1) and pushed["force"]["Z"] < 0.5
    # Eight newtons upwards in the world, whichever way the vehicle leans.
    assert np.hypot.reduce([lifted["force"][a] for a in "XYZ"]) == pytest.approx(8.0, rel=0.1)
    assert pushed["share"] > 0.02 and pushed["matters"] and lifted["matters"]


def test_each_cost_is_that_of_the_name_beside_the_other(two):
    pushed, lifted = two.matters["constant_force"], two.matters["net_buoyancy"]
    assert pushed["worst"]["velocity"] == "u"
    # Without it the constant force takes the mean of its heave force over: what cannot be taken over is the part that
    # turns into surge and sway with the tilt.
    assert lifted["worst"]["velocity"] in ("u", "v") and lifted["worst"]["cost"] >= lifted["cost"]
    assert pushed["worst"]["cost"] >= pushed["cost"] > 1.0
    by_name = {c["effect"]: c for c in two.candidates}
    for name in NAMES:
        own = by_name[name]
        assert own["cv_before"] > own["cv_after"] and 0.0 < own["explained"] < 1.0
    # One candidate's figures are its own: the shares of two that act apart do not each claim the whole.
    assert sum(by_name[n]["explained"] for n in NAMES) <= 1.0
    assert by_name["constant_force"]["cv_before"] != pytest.approx(
        by_name["net_buoyancy"]["cv_before"], rel=1e-3
    )
    assert any(line.startswith("constant_force: without it") for line in two.story)
    json.dumps(two.to_dict(), allow_nan=False)


def test_what_is_there_and_does_not_matter_comes_last_and_is_marked(model):
    truth = {"net_buoyancy": {"force": 0.35}, "constant_force": {"X": 6.0}}
    found = found_in(model, truth, tolerance=0.6)
    assert found.missing == ["constant_force", "net_buoyancy"]
    assert found.matters["constant_force"]["matters"] and not found.matters["net_buoyancy"]["matters"]
    assert any("does not matter within the tolerance" in line for line in found.story)
    strict = found_in(model, truth, tolerance=0)
    assert set(strict.missing) == set(NAMES) and all(m["matters"] for m in strict.matters.values())


def test_where_nothing_is_found_the_smallest_force_that_would_have_shown_is_told(model):
    found = found_in(model, {})
    assert found.verdict == "adequate" and found.matters == {}
    assert 0.0 < found.left["X"]["detectable"] < 1.0 and found.left["X"]["upper"] < 1.0
    assert any("would have shown" in line for line in found.story)


def test_costs_can_be_left_out(model):
    found = found_in(model, {"constant_force": {"X": 6.0}}, tolerance=0, costs=False)
    assert found.matters["constant_force"]["cost"] is None
    assert found.matters["constant_force"]["force"]["X"] == pytest.approx(6.0, rel=0.1)


def test_a_coefficient_that_moved_far_is_told_with_how_far(model):
    truth = GreyBox(small_vehicle(linear_damping=[25.0, 35.0, 40.0, 4.0, 5.0, 5.0 * 1.35]))
    log = make_log(truth, runs=3, duration=15.0, noise=0.3, seed=6)
    found = diagnose(model, log, ["net_buoyancy"], advice=False, whiteness=False, costs=False, tolerance=0)
    told = {(m["group"], m["coefficient"]): m for m in found.moved}
    one = told["linear_damping", "N"]
    assert one["fitted"] == pytest.approx(1.35, abs=0.15) and one["deviations"] == pytest.approx(3.5, abs=1.5)
    assert "linear_damping.N times 1." in moved_words(found.moved)[0]
    assert any("more than two of their standard deviations" in line for line in found.story)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        (None, (0.1, 0.02)),
        (0, (0.0, 0.0)),
        (0.5, (0.5, 0.1)),
        ({"cost": 0.3}, (0.3, 0.02)),
        ({"force": 0.0}, (0.1, 0.0)),
    ],
)
def test_a_tolerance_is_read(value, wanted):
    read = Tolerance.of(value)
    assert (read.cost, read.force) == pytest.approx(wanted)
    assert read.strict == (wanted == (0.0, 0.0))


@pytest.mark.parametrize("value", [-0.1, "much", True, {"costs": 1}, {"cost": float("inf")}])
def test_what_is_no_tolerance_is_refused(value):
    with pytest.raises(ConfigError, match="tolerance"):
        Tolerance.of(value)
