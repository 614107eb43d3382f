"""A buoyancy and a constant force: the same while a vehicle is upright, and the buoyancy is the plainer cause."""

from __future__ import annotations

import numpy as np
import torch

import auvnn
from auvnn.models import load
from auvnn.simulation import simulate

FORCE = 4.0


def acceleration(effect: str, values: dict[str, float], roll: float) -> np.ndarray:
    """Return the acceleration at rest of a vehicle at an angle of roll, its thrusters still."""
    model = load("bluerov2_heavy").with_effects({effect: values})
    eta = torch.tensor([0.0, 0.0, 5.0, roll, 0.0, 0.0], dtype=torch.float64)
    still = torch.zeros(model.actuators.size, dtype=torch.float64)
    return model(eta, torch.zeros(6, dtype=torch.float64), still).detach().numpy()


def test_upright_they_do_the_same_and_on_its_side_they_do_not():
    up = {"force": FORCE}, {"Z": -FORCE}
    buoyant, forced = (
        acceleration(n, v, 0.0) for n, v in zip(("net_buoyancy", "constant_force"), up, strict=True)
    )
    np.testing.assert_allclose(buoyant, forced, atol=1e-9)
    lying = [
        acceleration(n, v, np.pi / 2) for n, v in zip(("net_buoyancy", "constant_force"), up, strict=True)
    ]
    assert np.abs(lying[0] - lying[1]).max() > 0.1


def test_a_buoyancy_is_not_told_as_a_constant_force_in_a_simulator_without_added_mass_coriolis():
    # By its slope a constant force has so much more evidence that the buoyancy would not be fitted.
    how = {"plant": "numpy", "world": "conventions", "runs": 2, "duration": 30.0, "rate": 20.0, "seed": 7}
    log = simulate(
        load("bluerov2_heavy"), "survey", "realistic", hidden={"net_buoyancy": {"force": FORCE}}, **how
    ).log
    asked = ["added_mass_coriolis", "net_buoyancy", "constant_force"]
    found = auvnn.diagnose("bluerov2_heavy", log, effects=asked, advice=False, whiteness=False)
    assert [s["effects"] for s in found.steps if s["effects"]] == [["net_buoyancy"], ["added_mass_coriolis"]]
