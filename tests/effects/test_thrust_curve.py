"""Another power of the command: against the power by hand, and against the vendor's table of a thruster."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

UNIT = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 40.0, "max_reverse": 30.0}
ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(os.environ.get("AUVNN_DATA", ROOT.parent / "shared" / "data")) / "t200" / "static.csv"


def thrust(model, level, still, command):
    """Return the force, N, of the only thruster at rest."""
    return model(level, still, torch.tensor([command], dtype=torch.float64))[0] * 70.0


@pytest.mark.parametrize(("ahead", "astern"), [(0.6, 1.0), (1.0, 0.8), (1.7, 1.2)])
def test_thrust_follows_the_powers_and_is_full_at_full_command(level, still, ahead, astern):
    powers = {"thruster_1_positive": ahead, "thruster_1_negative": astern}
    model = GreyBox(plain_vehicle(thrusters=[UNIT])).with_effects({"thrust_curve": powers})
    for c in (-1.0, -0.6, -0.01, 0.0, 0.02, 0.5, 1.0):
        expected = 40.0 * c ** (2.0 * ahead) if c > 0 else -30.0 * abs(c) ** (2.0 * astern)
        assert thrust(model, level, still, c).item() == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_at_its_null_it_changes_nothing_to_the_last_bit_and_its_slope_is_that_of_the_power(level, still):
    """T = F |c|^(2 m), so dT/dm = 2 F c^2 ln|c| at m = 1."""
    bare = GreyBox(plain_vehicle(thrusters=[UNIT]))
    model = bare.with_effects(["thrust_curve"])
    for c in (-0.6, 0.0, 0.3, 1.0):
        value = thrust(model, level, still, c)
        assert torch.equal(value, thrust(bare, level, still, c))
        (slope,) = torch.autograd.grad(value, model.effects[0].theta)
        bent = 2.0 * c * c * np.log(abs(c)) if c else 0.0
        expected = [40.0 * bent, 0.0] if c > 0 else [0.0, -30.0 * bent]
        assert slope.tolist() == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_a_commanded_wrench_has_two_exponents_for_each_degree_of_freedom(plain, level, still):
    """Without thrusters full effort is a tenth of the weight, at half the length."""
    full = np.array([49.05] * 3 + [24.525] * 3)
    command, powers = np.array([20.0, -3.0, 60.0, 2.0, -12.0, 24.0]), np.array([0.7, 1.5, 0.9, 1.0, 2.0, 0.5])
    sides = np.where(command > 0, "positive", "negative")
    names = [f"{axis}_{side}" for axis, side in zip("XYZKMN", sides, strict=True)]
    model = plain({"thrust_curve": dict(zip(names, powers.tolist(), strict=True))})
    expected = np.sign(command) * full * (np.abs(command) / full) ** powers
    expected = expected / np.array([70, 80, 90, 3, 4.5, 6.5])
    np.testing.assert_allclose(model(level, still, torch.tensor(command)).detach(), expected, rtol=1e-12)


@pytest.mark.skipif(
    not TABLE.exists(), reason="the T200's table is not here: set AUVNN_DATA to the folder above t200/"
)
def test_the_t200_is_met_by_a_power_twice_as_well_as_by_a_dead_band(level, still):
    """What the docstring states: at each voltage, ahead and astern, gain and one parameter fitted to the table."""
    table = np.genfromtxt(TABLE, delimiter=",", names=True)
    left, found = {"thrust_curve": [], "thruster_deadband": []}, []
    for voltage in np.unique(table["voltage_V"]):
        for side in (1.0, -1.0):
            rows = table[table["voltage_V"] == voltage]
            command, force = side * (rows["pwm_us"] - 1500.0) / 400.0, side * rows["force_kgf"]
            command, force = command[command > 0.02], force[command > 0.02]
            most = force[np.argmax(command)]

            def misfit(q, shape, command=command, force=force, most=most):
                return (q[0] * shape(command, q[1]) - force) / most

            for name, shape, start in (
                ("thrust_curve", lambda c, m: c ** (2.0 * m), 1.0),
                ("thruster_deadband", lambda c, w: (np.maximum(c - w, 0.0) / (1.0 - w)) ** 2, 0.05),
            ):
                fit = least_squares(misfit, [most, start], args=(shape,))
                left[name].append(np.sqrt(np.mean(fit.fun**2)))
                if name == "thrust_curve":
                    found.append(fit.x[1])
    assert (min(found), max(found)) == pytest.approx((0.78, 0.91), abs=0.01)
    assert np.mean(left["thrust_curve"]) == pytest.approx(0.0085, abs=5e-4)
    assert np.mean(left["thruster_deadband"]) == pytest.approx(0.017, abs=1e-3)
