"""A controller that answers its sensors' noise, or an unknown current, makes no thruster look exchanged."""

from __future__ import annotations

import numpy as np

from auvnn.checks.actuator_prediction import predicts_better
from auvnn.checks.actuators import check_actuators
from auvnn.models import load
from auvnn.simulation import simulate
from auvnn.studies.benchmark.one_log import conditions
from auvnn.studies.demo import VEHICLE, made_logs
from tests.studies.benchmark.plans import of_plan


def test_what_feedback_and_coloured_noise_seem_to_say_is_not_said():
    """A log on which the regression alone was sure (99.2 %) of two exchanges, with nothing wrong."""
    case = [c for c in of_plan("worlds_made")[1] if c.part == "sensors_nothing"][1]
    model = load(case.vehicle)
    made = simulate(
        model,
        coefficients=case.coefficients,
        max_step=0.025,
        plant=case.plant,
        world=case.world,
        **conditions(case),
    )
    found = check_actuators(model, made.log)
    assert found.words == []
    # The same log tells an actuator that is turned round in the model file.
    changed = model.actuators.allocation.numpy() * np.where(np.arange(6) == 0, -1.0, 1.0)[:, None]
    wrong = model.rebuilt(model.copied_effects())
    wrong.actuators.allocation.copy_(wrong.actuators.allocation.new_tensor(changed))
    assert predicts_better(wrong, made.log, model.actuators.allocation.numpy())
    assert not predicts_better(model, made.log, changed)


def test_a_current_makes_no_thruster_look_exchanged():
    """The demo's log: thrusters driven against a current that the model does not know."""
    model = load(VEHICLE)
    log = made_logs(model)[0].log
    for part in (log, log.split()[0]):
        assert check_actuators(model, part).words == []
