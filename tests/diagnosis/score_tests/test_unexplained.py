"""What a fit leaves of the acceleration, and waves that are found by it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.score_tests.null_tests import NullTests
from auvnn.diagnosis.score_tests.probes import MANY, extent_of, probed
from auvnn.diagnosis.score_tests.shape_search import searched_start
from auvnn.diagnosis.score_tests.unexplained import unexplained
from auvnn.metrics.windows import ATTITUDE, POSITION, VELOCITY
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

# Between two frequencies that are asked for without a look at what is left, and between phases and directions.
WAVE = {"amplitude": 0.15, "omega": 1.452, "phase": 0.8, "direction": 1.05}


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def fitted(model, log, names):
    windows, layout = windows_for(model, log), lay_out(model, names)
    base = list(layout.nuisance)
    return windows, layout, base, fit_hypothesis(layout, windows, base, ())


@pytest.fixture(scope="module")
def waves(model):
    """A log with a wave that no start has, and the fit without it."""
    log = make_log(model.with_effects({"waves": WAVE}), runs=2, duration=60.0, rate=10.0, noise=0.3)
    return fitted(model, log, ["waves", "ocean_current", "thruster_gain"])


def test_it_is_the_force_over_the_mass_that_it_moves(model):
    """A force that the model lacks, as the windows begin: later the drag answers it."""
    force = 6.0
    log = make_log(
        model.with_effects({"net_buoyancy": {"force": force}}), runs=1, duration=30.0, rate=10.0, size=0.2
    )
    windows = windows_for(model, log, window=1.0)
    layout = lay_out(model, ["net_buoyancy"])
    found = fit_hypothesis(layout, windows, list(layout.nuisance), (), iterations=0)
    left = unexplained(windows, found)
    assert left is not None
    vehicle = model.vehicle
    # Upwards, of axes that point down.
    expected = -force / (vehicle.mass + vehicle.added_mass[2, 2])
    assert left.acceleration.mean(0)[2] == pytest.approx(expected, rel=0.2)
    assert np.abs(left.acceleration.mean(0)[:2]).max() < 0.1 * abs(expected)
    assert len(left.time) == len(left.position) == len(left.acceleration)


def test_nothing_is_left_to_look_at_without_positions_or_with_few_velocities(waves):
    windows, _, _, found = waves
    blind = windows.mask.clone()
    blind[..., POSITION] = 0
    assert unexplained(replace(windows, mask=blind), found) is None
    few = windows.mask.clone()
    few[:, 1:, VELOCITY] = 0
    assert unexplained(replace(windows, mask=few), found) is None
    # Every fifth velocity is as good as all of them, a quarter of a second apart or more.
    some = torch.zeros_like(windows.mask)
    some[:, ::5] = windows.mask[:, ::5]
    left = unexplained(replace(windows, mask=some), found)
    whole = unexplained(windows, found)
    assert left is not None and whole is not None and len(left.time) < len(whole.time)


def test_slow_positions_are_interpolated_and_what_has_no_attitude_is_left_out(waves):
    windows, _, _, found = waves
    whole = unexplained(windows, found)
    slow, blind = windows.mask.clone(), windows.mask.clone()
    slow[:, 1::10, POSITION] = slow[:, 2::10, POSITION] = slow[:, 4::10, POSITION] = 0
    gone = (slow[..., POSITION] == 0).all(-1)
    eta = windows.eta.clone()
    eta[..., :3][gone] = 0.0
    left = unexplained(replace(windows, mask=slow, eta=eta), found)
    assert left is not None and whole is not None
    assert np.abs(left.position - whole.position).max() < 0.15
    blind[:, 5:, ATTITUDE] = 0
    some = unexplained(replace(windows, mask=blind), found)
    assert some is None or len(some.time) < 0.2 * len(whole.time)


def test_what_is_chosen_by_what_is_left_counts_as_one_of_many(waves):
    windows, layout, _, found = waves
    extent = replace(extent_of(windows), left=unexplained(windows, found))
    assert probed(layout, ["waves"], extent).counts == {"waves": MANY}
    assert probed(layout, ["waves"], extent.unseen()).counts == {}
    given = probed(layout, ["waves"], extent, {"waves": [{"omega": 1.0, "phase": 0.0, "direction": 0.0}]})
    assert given.counts == {}


def test_a_wave_between_the_starts_is_found_by_what_is_left_and_closer_looks(waves, monkeypatch):
    windows, layout, base, found = waves
    names = ["waves", "ocean_current", "thruster_gain"]
    asked = NullTests(layout, windows, lambda _: None)
    sharp = asked(found, names, base, []).scores["waves"]
    monkeypatch.setattr("auvnn.diagnosis.score_tests.null_tests.unexplained", lambda *_: None)
    monkeypatch.setattr(asked, "_nearer", lambda *_: {})
    plain = asked(found, names, base, []).scores["waves"]
    # Half of what there is, and more, is out of reach of a frequency that is half a step off.
    assert sharp.gain > 2.0 * plain.gain and sharp.p_value < plain.p_value and sharp.evidence > plain.evidence
    amplitude, omega, phase, direction = sharp.estimate
    assert abs(omega - WAVE["omega"]) < 0.02
    assert abs(math.remainder(phase - WAVE["phase"] - (0 if amplitude > 0 else math.pi), 2 * math.pi)) < 0.6
    assert abs(math.remainder(direction - WAVE["direction"], 2 * math.pi)) < 0.3


def test_a_wave_that_is_asked_for_by_name_begins_there(waves):
    windows, layout, base, found = waves
    guess = searched_start(layout, windows, found, base, "waves")
    assert guess is not None
    values = guess.model.effect("waves").values()
    assert abs(values["omega"] - WAVE["omega"]) < 0.02
    fit = fit_hypothesis(layout, windows, base, ("waves",), start=found.fitted, guess=guess)
    assert fit.fitted.model.effect("waves").values()["omega"] == pytest.approx(WAVE["omega"], abs=0.003)
