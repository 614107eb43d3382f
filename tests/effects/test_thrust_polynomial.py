"""A thrust curve off by a polynomial: against numpy's Legendre series, a curve of another form, a vendor's table."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.polynomial.legendre import legval
from scipy.optimize import least_squares

from tests.effects.one_thruster import measured, model_with, needs_table, thrust

COMMANDS = (-1.0, -0.6, -0.01, 0.0, 0.02, 0.5, 1.0)


def coefficients(*values, actuator="thruster_1"):
    """Return parameters of one actuator, degrees 1 to 4."""
    return {f"{actuator}_degree_{k}": v for k, v in enumerate(values, 1)}


def quadratic(command):
    """Return the stated thrust, N."""
    return 40.0 * command**2 if command > 0 else -30.0 * command**2


@pytest.mark.parametrize(
    "series", [(0.1, 0, 0, 0), (0, -0.2, 0, 0), (0, 0, 0.15, 0), (0.05, -0.1, 0.02, 0.2)]
)
def test_each_command_is_changed_by_the_series(series):
    model = model_with({"thrust_polynomial": coefficients(*series)})
    for c in COMMANDS:
        expected = quadratic(c * (1.0 + legval(c, [0.0, *series])))
        assert thrust(model, c).item() == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_at_its_null_it_changes_nothing_to_the_last_bit_and_its_slopes_are_twice_the_polynomials():
    """T = F c^2 (1 + q)^2, so dT/da_k = 2 F c^2 P_k(c) at q = 0."""
    bare, model = model_with({}), model_with(["thrust_polynomial"])
    for c in COMMANDS:
        value = thrust(model, c)
        assert torch.equal(value, thrust(bare, c))
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


def left(names, c, wanted, scale=1.0):
    """Return the rms, N, of what a gain and effects leave of thrusts, fitted from where they change nothing.

    Args:
        names: of effects besides the gain.
        c: commands, (n,).
        wanted: thrusts, N, (n,).
        scale: what the vehicle's thrust is multiplied by, (n,).
    """
    model = model_with(["thruster_gain", *names])
    effects = [e.theta for e in model.effects]

    def misfit(q):
        with torch.no_grad():
            for theta, part in zip(effects, torch.as_tensor(q).split([len(t) for t in effects]), strict=True):
                theta.copy_(part)
            return scale * thrust(model, c).numpy() - wanted

    start = np.concatenate([t.detach().numpy() for t in effects])
    return np.sqrt(np.mean(least_squares(misfit, start, diff_step=1e-6).fun ** 2))


FORMS = ["thrust_asymmetry", "thrust_curve"]


# In shares of full thrust.
@pytest.mark.parametrize(
    ("phase", "by_polynomial", "by_forms"),
    [(0.0, 0.0002, 0.0009), (1.0, 0.0008, 0.0026), (2.5, 0.0006, 0.0017), (4.0, 0.0008, 0.0023)],
)
def test_of_a_curve_that_waves_about_the_stated_one_it_leaves_a_third_of_what_other_forms_do(
    phase, by_polynomial, by_forms
):
    """T (1 + 0.05 cos(pi c + phase)) is of no form that is fitted: gain and series, or gain, jump and two exponents."""
    c = np.linspace(-1.0, 1.0, 201)
    wanted = np.array([quadratic(x) for x in c]) * (1.0 + 0.05 * np.cos(np.pi * c + phase))
    assert left(["thrust_polynomial"], c, wanted) / 40.0 == pytest.approx(by_polynomial, abs=6e-5)
    assert left(FORMS, c, wanted) / 40.0 == pytest.approx(by_forms, abs=6e-5)


@needs_table
def test_the_t200_is_met_as_well_as_by_a_power():
    """What the docstring states: at each voltage, both directions together, in shares of full thrust ahead."""
    found = {(): [], ("thrust_curve",): [], ("thrust_polynomial",): []}
    for command, force in measured():
        ahead, astern = force[np.argmax(command)], -force[np.argmin(command)]
        scale = np.where(command > 0.0, ahead / 40.0, astern / 30.0)
        for names, errors in found.items():
            errors.append(left(names, command, force, scale) / ahead)
    alone, power, polynomial = (np.mean(errors) for errors in found.values())
    assert alone == pytest.approx(0.039, abs=1e-3)
    assert power == pytest.approx(0.0076, abs=5e-4)
    assert polynomial == pytest.approx(0.0082, abs=5e-4)
