"""Waves: against the equations that define them, and the orbits of what drifts in them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from auvnn.diagnosis.answers.describe_parameters import describe_parameters
from auvnn.effects import Extent, Moment
from auvnn.effects.hooks import Unexplained
from auvnn.effects.waves import Waves
from auvnn.testing import plain_vehicle

VALUES = {"amplitude": 0.4, "omega": 1.1, "phase": 0.7, "direction": 2.0}


def water(place, time, values=VALUES):
    wave = Waves.build(plain_vehicle(), "wrench", values)
    six = torch.zeros(*place.shape[:-1], 6, dtype=torch.float64)
    moment = Moment(time, place, torch.eye(3, dtype=torch.float64), six, six, six, six)
    return wave.water(moment)


def test_the_water_is_incompressible_irrotational_and_obeys_laplace():
    for place in torch.tensor(np.random.default_rng(0).uniform(1, 9, size=(5, 3))):
        time = torch.tensor(3.3, dtype=torch.float64)
        gradient = torch.autograd.functional.jacobian(lambda p, t=time: water(p, t)[0], place).numpy()
        assert np.trace(gradient) == pytest.approx(0, abs=1e-15)
        np.testing.assert_allclose(gradient, gradient.T, atol=1e-15)
        rate = torch.autograd.functional.jacobian(lambda t, p=place: water(p, t)[0], time)
        torch.testing.assert_close(water(place, time)[1].detach(), rate, rtol=1e-12, atol=1e-15)


def test_the_surface_moves_as_the_elevation_says():
    """At z = 0 the water rises as fast as a cos(k xi - omega t + phase): w = -d/dt of it, z being down."""
    k, place = 1.1**2 / 9.81, np.array([3.0, -2.0, 0.0])
    for t in (0.0, 1.3, 4.0):
        angle = k * (place[0] * math.cos(2.0) + place[1] * math.sin(2.0)) - 1.1 * t + 0.7
        velocity = water(torch.tensor(place), torch.tensor(t, dtype=torch.float64))[0].tolist()
        assert velocity[2] == pytest.approx(-0.4 * 1.1 * math.sin(angle))
        # Under a crest the water goes the way of the wave.
        assert velocity[:2] == pytest.approx([0.44 * math.cos(angle) * f(2.0) for f in (math.cos, math.sin)])


def test_it_dies_out_with_depth_by_the_wave_number():
    time = torch.tensor(0.0, dtype=torch.float64)
    shallow, deep = (water(torch.tensor([0.0, 0.0, z], dtype=torch.float64), time)[0] for z in (2.0, 12.0))
    torch.testing.assert_close(deep, shallow * math.exp(-10 * 1.1**2 / 9.81), rtol=1e-12, atol=0)


def test_a_body_as_heavy_as_water_moves_with_it(plain, vector, still):
    """Neutral, with m = rho V, it takes the water's acceleration whatever its added mass, were it not to turn."""
    model = plain({"waves": {**VALUES, "direction": 0.0}})
    at = vector(1.0, 2.0, 4.0, 0, 0, 0)
    velocity, acceleration = water(
        at[:3], torch.tensor(2.0, dtype=torch.float64), {**VALUES, "direction": 0.0}
    )
    nu = torch.cat([velocity, torch.zeros(3, dtype=torch.float64)])
    rate = model(at, nu, still, time=2.0)
    torch.testing.assert_close(rate[:3], acceleration, rtol=1e-12, atol=1e-15)


def test_a_fixed_body_feels_displaced_and_added_mass(plain, vector, still):
    """At rest with enormous mass, F = (rho V + A) a by Morison's inertia term, less drag, which is none here."""
    at = vector(1.0, 2.0, 4.0, 0, 0, 0)
    bare, model = (plain(e, mass=5e8, buoyancy=490.5) for e in (None, {"waves": VALUES}))
    time = 2.0
    change = (model(at, still, still, time=time) - bare(at, still, still, time=time))[:3] * 5e8
    acceleration = water(at[:3], torch.tensor(time, dtype=torch.float64))[1]
    # Munk's moments turn it, but the force on a body that does not move also holds -C_A(nu_r) nu_r = 0 in front.
    expected = (50 + torch.tensor([20.0, 30, 40], dtype=torch.float64)) * acceleration
    torch.testing.assert_close(change, expected, rtol=1e-4, atol=1e-4)


def test_a_wave_is_told_with_a_height_above_zero_and_angles_within_half_a_turn():
    """The same water moves, whatever of the many values that mean one wave a fit has ended at."""
    found = {
        **VALUES,
        "amplitude": -0.4,
        "phase": 0.7 - math.pi + 4 * math.pi,
        "direction": 2.0 - 2 * math.pi,
    }
    stated = Waves.told(found)
    assert stated == pytest.approx(VALUES) and Waves.told(stated) == stated
    at, time = torch.tensor([3.0, -2.0, 1.0], dtype=torch.float64), torch.tensor(1.3, dtype=torch.float64)
    for a, b in zip(water(at, time, found), water(at, time, stated), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-12, atol=1e-14)


def test_answers_tell_the_wave_so_with_the_standard_errors_of_the_fit(plain):
    effect = plain({"waves": {**VALUES, "amplitude": -0.4}}).effect("waves")
    found = describe_parameters(effect, effect.theta.detach().numpy(), np.array([0.1, 0.2, 0.3, 0.4]))
    assert found["amplitude"] == {"value": pytest.approx(0.4), "std": 0.1, "unit": "m"}
    assert found["phase"]["value"] == pytest.approx(0.7 - math.pi) and found["direction"]["std"] == 0.4


def orbit(seed=0, speed=1.2, seconds=60.0):
    """Return times and places of a vehicle that turns about, (N,), (N, 3)."""
    time = np.arange(0.0, seconds, 0.25)
    heading = np.cumsum(np.random.default_rng(seed).normal(0.0, 0.1, len(time)))
    steps = 0.25 * speed * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    depth = 3.0 + np.sin(0.1 * time)
    return time, np.concatenate([steps.cumsum(0), depth[:, None]], axis=1)


@pytest.mark.parametrize("seconds", [60.0, 600.0])
@pytest.mark.parametrize(("omega", "direction", "among"), [(1.752, 1.05, 1), (1.31, -2.4, 2), (0.68, 3.0, 3)])
def test_the_wave_that_what_is_left_looks_like_is_asked_for(omega, direction, among, seconds):
    """The water's acceleration by the effect's own equations, a share of it, later, with as much noise.

    Other directions look like it where the way has few of its lengths, as a long and slow wave has.
    """
    time, place = orbit(seconds=seconds)
    values = {"amplitude": 0.2, "omega": omega, "phase": 0.4, "direction": direction}
    left = 0.6 * water(torch.tensor(place), torch.tensor(time - 0.3), values)[1].detach().numpy()
    left = left + np.random.default_rng(1).normal(0.0, left.std(), left.shape)
    extent = Extent(0.0, seconds, seconds, left=Unexplained(time, place, left))
    starts = Waves.starts((), extent)
    assert len(starts) == 4 * 8 and len({s["phase"] for s in starts}) == 4
    near = [
        s
        for s in starts[: 4 * among]
        if abs(s["omega"] - omega) < math.pi / seconds
        and abs(math.remainder(s["direction"] - direction, 2 * math.pi)) < 0.35
    ]
    assert near
    # Without what is left, nothing depends on it.
    assert Waves.starts((), extent.unseen()) == Waves.starts((), Extent(0.0, seconds, seconds)) != starts


def test_a_weak_wave_in_a_long_run_is_found_by_all_moments():
    """Noise has three times its size: what some of the moments put first is compared with all of them."""
    time, place = orbit(seconds=600.0)
    values = {"amplitude": 0.2, "omega": 1.31, "phase": 0.4, "direction": -2.4}
    wave = water(torch.tensor(place), torch.tensor(time), values)[1].detach().numpy()
    for seed in range(6):
        left = wave + np.random.default_rng(seed).normal(0.0, 3.0 * wave.std(), wave.shape)
        extent = Extent(0.0, 600.0, 600.0, left=Unexplained(time, place, left))
        first = Waves.starts((), extent)[0]
        assert abs(first["omega"] - 1.31) < math.pi / 600
        assert abs(math.remainder(first["direction"] + 2.4, 2 * math.pi)) < 0.35


def test_closer_looks_keep_the_phase_in_the_middle_of_the_log_and_come_to_an_end():
    extent, shape = Extent(10.0, 60.0, 60.0), {"omega": 1.3, "phase": 0.5, "direction": 0.2}
    level, sizes = 0, []
    while around := Waves.closest((), extent, shape, level):
        for near in around:
            if near["omega"] != shape["omega"]:
                moved = near["phase"] - near["omega"] * 40.0 - (shape["phase"] - shape["omega"] * 40.0)
                steps = (k * math.pi / 2 * 2.0 ** -(level // 2 + 1) for k in (-1, 0, 1))
                assert min(abs(math.remainder(moved - step, 2 * math.pi)) for step in steps) < 1e-9
        sizes.append(max(abs(n["omega"] - shape["omega"]) for n in around))
        level += 1
    assert level == 6 and sizes[::2] == pytest.approx([sizes[0], sizes[0] / 2, sizes[0] / 4])
    assert sizes[1::2] == [0.0, 0.0, 0.0]
