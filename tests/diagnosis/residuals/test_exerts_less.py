"""What an effect leaves because its form is not quite right is less than the effect exerts itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.residuals.forces import actuators_of, exerts_less, forces_of
from auvnn.estimation.priors import set_parameters
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

# Of the four thrusters that push ahead, none of the others.
ASYMMETRY = np.array([0.1, 0.1, 0.1, 0.1, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def fit():
    model = GreyBox(small_vehicle())
    windows = windows_for(model, make_log(model))
    layout = lay_out(model, ["thrust_asymmetry", "constant_force"])
    base = [n for n in layout.names if n not in ("thrust_asymmetry", "constant_force")]
    return fit_hypothesis(
        layout, windows, base, ("thrust_asymmetry", "constant_force"), iterations=1
    ), windows


def with_force(fit, force: list[float], asymmetry=ASYMMETRY):
    found, windows = fit
    model = found.fitted.model.rebuilt(found.fitted.model.copied_effects())
    set_parameters(model, ["thrust_asymmetry", "constant_force"], np.concatenate([asymmetry, force]))
    return replace(found, fitted=replace(found.fitted, model=model)), windows


def of_asymmetry(windows) -> np.ndarray:
    """The rms force in surge by the commands alone: 40 N c^2 a along (1, -1) / sqrt(2), four times."""
    command = windows.inputs.command[:, windows.warmup :].numpy()
    thrust = 40.0 * command[..., :4] ** 2 * ASYMMETRY[:4]
    seen = np.arange(command.shape[1]) < windows.length[:, None]
    return np.sqrt(((thrust.sum(-1) / np.sqrt(2.0))[seen] ** 2).mean())


def test_forces_are_those_of_the_effects_own_equations(fit):
    found, windows = with_force(fit, [1.0, 0.0, 0.0, 0.0, 0.0, 0.2])
    forces = forces_of(found, windows, ["thrust_asymmetry", "constant_force"])
    np.testing.assert_allclose(forces["constant_force"], [1.0, 0.0, 0.0, 0.0, 0.0, 0.2], atol=1e-9)
    # The last row of a window has no command of its own.
    assert forces["thrust_asymmetry"][0] == pytest.approx(of_asymmetry(windows), rel=0.02)


@pytest.mark.parametrize(("times", "less"), [(0.5, True), (0.9, True), (1.1, False), (3.0, False)])
def test_it_is_compared_where_it_acts_most(fit, times, less):
    surge = times * of_asymmetry(fit[1])
    found = with_force(fit, [surge, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert exerts_less(*found, "constant_force", ["thrust_asymmetry"]) is less
    assert exerts_less(*found, "constant_force", ["thrust_asymmetry"], times=2.0) is (times < 2.0)


def test_a_small_part_where_the_earlier_one_does_not_act_does_not_count_and_a_large_one_does(fit):
    surge = 0.5 * of_asymmetry(fit[1])
    small, large = [surge, 0.0, 0.01, 0.0, 0.0, 0.0], [surge, 0.0, 60.0, 0.0, 0.0, 0.0]
    assert exerts_less(*with_force(fit, small), "constant_force", ["thrust_asymmetry"])
    assert not exerts_less(*with_force(fit, large), "constant_force", ["thrust_asymmetry"])


def test_it_must_exert_less_in_every_degree_of_freedom_in_which_it_acts_most(fit):
    """As large a share of the actuators' in heave as in surge, where the asymmetry exerts nothing."""
    surge = 0.5 * of_asymmetry(fit[1])
    drive = actuators_of(fit[0].fitted.model, fit[1])
    both = [surge, 0.0, surge * drive[2] / drive[0], 0.0, 0.0, 0.0]
    assert not exerts_less(*with_force(fit, both), "constant_force", ["thrust_asymmetry"])
