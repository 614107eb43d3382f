"""What a diagnosis may ask of logs that lack sensors, and over which windows."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import candidates_for, windows_for
from auvnn.logs.without_sensors import without
from auvnn.metrics.unmeasured import completed
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle
from tests.metrics.test_gliding import GLIDER, glide
from tests.small_logs import make_log, small_vehicle


def test_no_actuator_is_asked_of_a_glider():
    model = GreyBox(plain_vehicle(**GLIDER))
    log = completed(model, glide(np.zeros(200), np.full(200, -1e-5)))
    usable, needs = candidates_for(
        model, log, ["thruster_gain", "thruster_lag", "compressibility", "net_buoyancy"]
    )
    assert usable == ["compressibility", "net_buoyancy"]
    assert needs["thruster_gain"] == needs["thruster_lag"] == ["thrusters"]
    windows = windows_for(model, log)
    assert windows.max_step == pytest.approx(0.25)
    assert (
        float(windows.times[0, windows.length[0] - 1 + windows.warmup] - windows.times[0, windows.warmup])
        < 61.0
    )


def test_windows_are_longer_without_velocities_and_no_others_change():
    model = GreyBox(small_vehicle())
    whole = make_log(model, runs=2, duration=70.0, rate=5.0, seed=1)
    bare = completed(model, without(whole, ("u", "v", "w", "x", "y")))

    def longest(log):
        windows = windows_for(model, log)
        return float((windows.times[:, -1] - windows.times[:, windows.warmup]).max())

    assert longest(whole) == pytest.approx(5.0) and longest(bare) > 10.0
    usable, needs = candidates_for(model, bare, ["tether", "net_buoyancy"])
    assert usable == ["net_buoyancy"] and needs["tether"] == ["x", "y"]
