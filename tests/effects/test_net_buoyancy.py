"""Net buoyancy: against a free rise, its terminal speed, and the lever of the centre of buoyancy."""

from __future__ import annotations

import math

import pytest
import torch


def test_it_lifts_by_force_over_heave_inertia(plain, level, still):
    acceleration = plain({"net_buoyancy": {"force": 9.0}})(level, still, still)
    assert acceleration.tolist() == pytest.approx([0, 0, -9.0 / 90, 0, 0, 0], abs=1e-15)


def test_upside_down_it_still_lifts(plain, vector, still):
    acceleration = plain({"net_buoyancy": {"force": 9.0}})(vector(0, 0, 0, math.pi, 0, 0), still, still)
    assert acceleration[2].item() == pytest.approx(9.0 / 90, 1e-12)


def test_a_free_rise_ends_at_the_speed_at_which_drag_balances_it(plain, level, still):
    """From rest m dw/dt = -F + q w2 has the solution -sqrt(F/q) tanh(t sqrt(F q)/m)."""
    model = plain({"net_buoyancy": {"force": 10.0}}, quadratic_damping=[20, 30, 40, 2, 2, 2])
    times = torch.arange(0, 16, 0.2, dtype=torch.float64)
    with torch.no_grad():
        run = model.rollout(
            level, still, torch.zeros(len(times), 6, dtype=torch.float64), times, max_step=0.1
        )
    speed = [-math.sqrt(10 / 40) * math.tanh(t * math.sqrt(10 * 40) / 90) for t in times.tolist()]
    assert run.nu[:, 2].tolist() == pytest.approx(speed, abs=1e-8)
    assert abs(speed[-1]) > 0.99 * math.sqrt(10 / 40)


def test_it_acts_at_the_centre_of_buoyancy(plain, level, still):
    model = plain(
        {"net_buoyancy": {"force": 9.0}}, center_of_buoyancy=[0.1, 0.0, 0.0], center_of_gravity=[0.1, 0, 0]
    )
    bare = plain(center_of_buoyancy=[0.1, 0.0, 0.0], center_of_gravity=[0.1, 0, 0])
    assert bare(level, still, still).abs().max() < 1e-14
    # A lift ahead of the origin raises the nose.
    assert (bare.prepare().total @ model(level, still, still)).tolist() == pytest.approx(
        [0, 0, -9.0, 0, 0.9, 0], abs=1e-12
    )
