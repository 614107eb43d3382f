"""Another power of the command: against the power by hand, and against the vendor's table of a thruster."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from tests.effects.one_thruster import measured, model_with, needs_table, thrust


@pytest.mark.parametrize(("ahead", "astern"), [(0.6, 1.0), (1.0, 0.8), (1.7, 1.2)])
def test_thrust_follows_the_powers_and_is_full_at_full_command(ahead, astern):
    powers = {"thruster_1_positive": ahead, "thruster_1_negative": astern}
    model = model_with({"thrust_curve": powers})
    for c in (-1.0, -0.6, -0.01, 0.0, 0.02, 0.5, 1.0):
        expected = 40.0 * c ** (2.0 * ahead) if c > 0 else -30.0 * abs(c) ** (2.0 * astern)
        assert thrust(model, c).item() == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_at_its_null_it_changes_nothing_to_the_last_bit_and_its_slope_is_that_of_the_power():
    """T = F |c|^(2 m), so dT/dm = 2 F c^2 ln|c| at m = 1."""
    bare, model = model_with({}), model_with(["thrust_curve"])
    for c in (-0.6, 0.0, 0.3, 1.0):
        value = thrust(model, c)
        assert torch.equal(value, thrust(bare, c))
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


@needs_table
def test_the_t200_is_met_by_a_power_twice_as_well_as_by_a_dead_band():
    """What the docstring states: at each voltage, ahead and astern, gain and one parameter fitted to the table."""
    left, found = {"thrust_curve": [], "thruster_deadband": []}, []
    for both, forces in measured():
        for side in (1.0, -1.0):
            here = side * both > 0.0
            command, force = side * both[here], side * forces[here]
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
