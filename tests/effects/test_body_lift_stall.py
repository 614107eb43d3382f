"""Lift of the hull that falls off across the flow: closed forms, in either order of the effects."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.errors import ConfigError
from auvnn.simulation import simulate

LIFT = {"Yuv": -12.0, "Zuw": -9.0, "Muw": -2.0, "Nuv": 3.0}
# Rigid and added, of the plain vehicle.
MASSES = np.array([70.0, 80.0, 90.0, 3.0, 4.5, 6.5])


def lift_of(plain, level, still, effects, nu):
    """Return what effects change of the wrench, N and N m."""
    nu = torch.tensor(nu, dtype=torch.float64)
    with torch.no_grad():
        return (plain(effects)(level, nu, still) - plain()(level, nu, still)).numpy() * MASSES


@pytest.mark.parametrize("first", ["body_lift", "body_lift_stall"])
@pytest.mark.parametrize("share", [0.3, 1.0])
def test_the_lift_goes_as_sine_and_cosine_of_the_angle(plain, level, still, first, share):
    both = {"body_lift": LIFT, "body_lift_stall": {"share": share}}
    effects = {first: both[first], **both}
    assert next(iter(effects)) == first
    speed = 0.8
    for angle in np.deg2rad([0.0, 10.0, 30.0, 60.0, 90.0, 150.0, -30.0]):
        kept = np.sin(angle) * np.cos(angle) * (1.0 - share + share * np.cos(angle) ** 2) * speed**2
        drift = lift_of(
            plain, level, still, effects, [speed * np.cos(angle), speed * np.sin(angle), 0, 0, 0, 0]
        )
        dive = lift_of(
            plain, level, still, effects, [speed * np.cos(angle), 0, speed * np.sin(angle), 0, 0, 0]
        )
        assert drift == pytest.approx([0, LIFT["Yuv"] * kept, 0, 0, 0, LIFT["Nuv"] * kept], abs=1e-12)
        assert dive == pytest.approx([0, 0, LIFT["Zuw"] * kept, 0, LIFT["Muw"] * kept, 0], abs=1e-12)


def test_at_a_share_of_one_it_is_largest_at_thirty_degrees(plain, level, still):
    effects = {"body_lift": LIFT, "body_lift_stall": {"share": 1.0}}
    angles = np.deg2rad(np.arange(1.0, 90.0))
    lifts = [lift_of(plain, level, still, effects, [np.cos(a), np.sin(a), 0, 0, 0, 0])[1] for a in angles]
    assert np.rad2deg(angles[np.argmin(lifts)]) == pytest.approx(30.0)


def test_without_a_lift_it_does_nothing_and_cannot_be_hidden(plain, level, still):
    assert not lift_of(
        plain, level, still, {"body_lift_stall": {"share": 0.8}}, [0.5, 0.4, 0.3, 0, 0, 0]
    ).any()
    with pytest.raises(ConfigError, match="hide body_lift with it"):
        simulate("rov95", "multisine", "none", {"body_lift_stall": None}, runs=1, duration=2.0)
