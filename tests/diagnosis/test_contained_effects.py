"""The lift of a hull contains a change of its Munk moment, which is the plainer cause."""

from __future__ import annotations

import numpy as np
import torch

import auvnn
from auvnn.models import load
from auvnn.simulation import simulate

PITCH, YAW = 0.4, 1.3


def test_a_lift_of_moments_alone_is_another_munk_moment():
    plain = load("rov95")
    surge, sway, heave = np.diag(np.asarray(plain.vehicle.added_mass))[:3]
    # M = (A33 - A11) u w and N = -(A22 - A11) u v are the ideal moments.
    moments = {"Muw": (PITCH - 1.0) * (heave - surge), "Nuv": -(YAW - 1.0) * (sway - surge)}
    models = [
        plain.with_effects({"munk_moment": {"pitch": PITCH, "yaw": YAW}}),
        plain.with_effects({"body_lift": moments}),
    ]
    states = np.random.default_rng(1).uniform(-1.0, 1.0, (20, 6))
    eta = torch.zeros(20, 6, dtype=torch.float64)
    still = torch.zeros(20, plain.actuators.size, dtype=torch.float64)
    munk, lift = (m(eta, torch.as_tensor(states), still).detach().numpy() for m in models)
    np.testing.assert_allclose(munk, lift, atol=1e-12)
    assert np.abs(munk - plain(eta, torch.as_tensor(states), still).detach().numpy()).max() > 0.01


def test_a_munk_moment_is_not_told_as_a_lift_where_the_attitude_is_off():
    # While the tilt has no name both are asked for together, and the lift takes up a part of the tilt.
    how = {"plant": "numpy", "world": "sensors", "runs": 2, "duration": 40.0, "rate": 20.0, "seed": 8}
    hidden = {"munk_moment": {"pitch": PITCH, "yaw": 1.0}}
    log = simulate(load("rov95"), "survey", "realistic", hidden=hidden, **how).log
    asked = ["munk_moment", "body_lift", "tilted_vertical"]
    found = auvnn.diagnose("rov95", log, effects=asked, advice=False, whiteness=False)
    assert set(found.missing) == {"munk_moment", "tilted_vertical"}
    told = next(c for c in found.candidates if c["effect"] == "munk_moment")["parameters"]["pitch"]
    assert abs(told["value"] - PITCH) < 3.0 * told["std"] < 0.1
