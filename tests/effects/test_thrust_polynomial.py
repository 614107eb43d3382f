"""A thrust curve off by a polynomial: against numpy's Legendre series, a curve of another form, a vendor's table."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.polynomial.legendre import legval
from scipy.optimize import least_squares

from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

UNIT = {"position": [0, 0, 0], "direction": [1, 0, 0], "max_forward": 40.0, "max_reverse": 30.0}
ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(os.environ.get("AUVNN_DATA", ROOT.parent / "shared" / "data")) / "t200" / "static.csv"
COMMANDS = (-1.0, -0.6, -0.01, 0.0, 0.02, 0.5, 1.0)


def coefficients(*values, actuator="thruster_1"):
    """Return parameters of one actuator, degrees 1 to 4."""
    return {f"{actuator}_degree_{k}": v for k, v in enumerate(values, 1)}


def thrust(model, level, still, command):
    """Return the force, N, of the only thruster at rest."""
    return model(level, still, torch.tensor([command], dtype=torch.float64))[0] * 70.0


def quadratic(command):
    """Return the stated thrust, N."""
    return 40.0 * command**2 if command > 0 else -30.0 * command**2


@pytest.mark.parametrize(
    "series", [(0.1, 0, 0, 0), (0, -0.2, 0, 0), (0, 0, 0.15, 0), (0.05, -0.1, 0.02, 0.2)]
)
def test_each_command_is_changed_by_the_series(level, still, series):
    model = GreyBox(plain_vehicle(thrusters=[UNIT])).with_effects(
        {"thrust_polynomial": coefficients(*series)}
    )
    for c in COMMANDS:
        expected = quadratic(c * (1.0 + legval(c, [0.0, *series])))
        assert thrust(model, level, still, c).item() == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_at_its_null_it_changes_nothing_to_the_last_bit_and_its_slopes_are_twice_the_polynomials(
    level, still
):
    """T = F c^2 (1 + q)^2, so dT/da_k = 2 F c^2 P_k(c) at q = 0."""
    bare = GreyBox(plain_vehicle(thrusters=[UNIT]))
    model = bare.with_effects(["thrust_polynomial"])
    for c in COMMANDS:
        value = thrust(model, level, still, c)
        assert torch.equal(value, thrust(bare, level, still, c))
        (slope,) = torch.autograd.grad(value, model.effects[0].theta)
        expected = [2.0 * quadratic(c) * legval(c, np.eye(5)[k]) for k in range(1, 5)]
        assert slope.tolist() == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_a_commanded_wrench_has_four_coefficients_in_each_degree_of_freedom(plain, level, still):
    """Without thrusters full effort is a tenth of the weight, at half the length; what is beyond counts as full."""
    full = np.array([49.05] * 3 + [24.525] * 3)
    command = np.array([20.0, -3.0, 60.0, 2.0, -30.0, 24.0])
    series = np.random.default_rng(3).uniform(-0.1, 0.1, (6, 4))
    values = {}
    for axis, row in zip("XYZKMN", series.tolist(), strict=True):
        values |= coefficients(*row, actuator=axis)
    model = plain({"thrust_polynomial": values})
    share = np.clip(command / full, -1.0, 1.0)
    error = [legval(c, [0.0, *row]) for c, row in zip(share, series, strict=True)]
    expected = command * (1.0 + np.array(error)) / np.array([70, 80, 90, 3, 4.5, 6.5])
    np.testing.assert_allclose(model(level, still, torch.tensor(command)).detach(), expected, rtol=1e-12)


def waves_about(phase):
    """Return commands and thrust, N, off by up to 5 % as cos(pi c + phase)."""
    c = np.linspace(-1.0, 1.0, 201)
    return c, np.array([quadratic(x) for x in c]) * (1.0 + 0.05 * np.cos(np.pi * c + phase))


def by_polynomial(c, q):
    """Return what a gain and four coefficients give, N."""
    return q[0] * np.array([quadratic(x) for x in c * (1.0 + legval(c, [0.0, *q[1:]]))])


def by_power(c, q):
    """Return what a gain, a jump and two exponents give, N."""
    power = np.where(c > 0.0, 40.0 * np.abs(c) ** (2.0 * q[2]), -30.0 * np.abs(c) ** (2.0 * q[3]))
    return q[0] * (1.0 + q[1] * np.sign(c)) * power


@pytest.mark.parametrize("phase", [0.0, 1.0, 2.5, 4.0])
def test_a_curve_that_waves_about_the_stated_one_is_met_better_than_by_gain_jump_and_powers(phase):
    c, wanted = waves_about(phase)
    poly = least_squares(lambda q: by_polynomial(c, q) - wanted, [1.0, 0.0, 0.0, 0.0, 0.0])
    power = least_squares(lambda q: by_power(c, q) - wanted, [1.0, 0.0, 1.0, 1.0])
    left, other = (np.sqrt(np.mean(fit.fun**2)) / 40.0 for fit in (poly, power))
    assert left < 0.001
    assert left < 0.4 * other


@pytest.mark.skipif(
    not TABLE.exists(), reason="the T200's table is not here: set AUVNN_DATA to the folder above t200/"
)
def test_the_t200_is_met_as_well_as_by_a_power():
    """What the docstring states: at each voltage, both directions together, a gain and the coefficients fitted."""
    table = np.genfromtxt(TABLE, delimiter=",", names=True)
    left = {0: [], 4: []}
    for voltage in np.unique(table["voltage_V"]):
        rows = table[table["voltage_V"] == voltage]
        command, force = (rows["pwm_us"] - 1500.0) / 400.0, rows["force_kgf"]
        moving = np.abs(command) > 0.02
        command, force = command[moving], force[moving]
        ahead, astern = force[np.argmax(command)], -force[np.argmin(command)]

        def misfit(q, command=command, force=force, ahead=ahead, astern=astern):
            c = command * (1.0 + legval(command, [0.0, *q[1:]]))
            return (q[0] * np.where(c > 0.0, ahead * c**2, -astern * c**2) - force) / ahead

        for degree, errors in left.items():
            fit = least_squares(misfit, [1.0, *[0.0] * degree])
            errors.append(np.sqrt(np.mean(fit.fun**2)))
    assert np.mean(left[4]) == pytest.approx(0.0082, abs=5e-4)
    assert np.mean(left[0]) == pytest.approx(0.039, abs=1e-3)
