"""Names together with a stochastic force, on small logs."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle

CANDIDATES = ["net_buoyancy", "thruster_gain", "thruster_lag", "added_mass", "gyro_bias"]
RMS, TIME = np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5]), 1.0


def said(hidden, seed=1, rms=RMS):
    model = GreyBox(small_vehicle())
    plant = model.with_effects(hidden) if hidden else model
    log = wandering_log(plant, rms, TIME, runs=2, duration=40.0, seed=seed)
    return diagnose(model, log, CANDIDATES, advice=False, whiteness=False, stochastic=True, max_effects=1)


def left_as_its_law(found):
    """Assert that what is left is the law's, and that this is what acts."""
    assert {"X", "Y", "Z", "cost"} <= found.left.keys()
    for axis, told in found.left.items():
        law = found.stochastic["force"].get(axis)
        if axis != "cost" and law is None:
            assert told["rms"] == 0.0 and told["correlation_time"] is None and told["detectable"] > 0.0
        elif axis != "cost":
            assert {n: told[n] for n in law} == law and told["upper"] > told["rms"]
            assert told["rms"] == pytest.approx(RMS["XYZKMN".index(axis)], rel=0.3)


@pytest.mark.long
def test_an_effect_is_named_and_the_force_beside_it_told():
    found = said({"net_buoyancy": {"force": 8.0}})
    assert found.verdict == "named" and found.missing == ["net_buoyancy"]
    assert {"X", "Y", "Z"} <= found.stochastic["force"].keys()
    for axis in "XYZ":
        assert found.stochastic["force"][axis]["rms"] == pytest.approx(4.0, rel=0.3)
        assert 0.4 < found.stochastic["force"][axis]["correlation_time"] < 2.5
    assert any("stochastic force" in line for line in found.story)
    left_as_its_law(found)
    parameters = found.candidates[0]["parameters"]["force"]
    assert parameters["value"] == pytest.approx(8.0, abs=4 * parameters["std"])


@pytest.mark.long
def test_a_force_alone_has_no_name():
    found = said({}, seed=2)
    assert found.missing == [] and found.verdict == "unknown" and found.stochastic["force"]
    left_as_its_law(found)


@pytest.mark.long
def test_without_a_force_the_answer_is_the_plain_search():
    found = said({"net_buoyancy": {"force": 8.0}}, rms=np.zeros(6))
    assert found.missing == ["net_buoyancy"] and "force" not in found.stochastic
