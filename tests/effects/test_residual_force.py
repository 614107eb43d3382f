"""Residual force: what it can learn, that it cannot add energy by velocity, and that its choice of inputs lasts."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.effects import EFFECTS, effect_class
from auvnn.effects.residual_force import INPUTS, ResidualForce
from auvnn.errors import ConfigError
from auvnn.models import GreyBox, load
from auvnn.testing import EFFECT_CHECKS, example_vehicle, make_scene, plain_vehicle

# The free parameters are more than so short a scene determines; fits are tested on a log.
CHECKS = [n for n in EFFECT_CHECKS if n not in ("recovers", "has_right_gradient", "transforms")]


@pytest.mark.parametrize("check", CHECKS)
def test_the_contract(check):
    EFFECT_CHECKS[check](ResidualForce, plain_vehicle(), "wrench")


@pytest.mark.parametrize("inputs", [["velocity"], ["tilt", "heading"]])
def test_its_derivatives_are_those_of_differences(inputs):
    vehicle = plain_vehicle()
    scene = make_scene(vehicle, "wrench", runs=3)
    effect = ResidualForce.build(vehicle, "wrench", drawn(vehicle, inputs))
    model = GreyBox(vehicle, [effect], actuation="wrench")
    row = scene.inputs.each()[0]

    def rate(theta):
        parameters = {"effects.0.theta": theta}
        return torch.func.functional_call(model, parameters, (scene.eta, scene.nu, row.command))

    theta = effect.theta.detach()
    found = torch.func.jacfwd(rate)(theta)
    torch.testing.assert_close(found, torch.func.jacrev(rate)(theta), rtol=1e-10, atol=1e-14)
    for k in range(0, len(theta), 7):
        step = torch.zeros_like(theta)
        step[k] = 1e-3
        difference = (rate(theta + step) - rate(theta - step)) / 2e-3
        torch.testing.assert_close(found[..., k], difference.detach(), rtol=1e-6, atol=1e-10)
        assert found[..., k].abs().max() > 1e-6


def test_it_is_known_but_not_offered():
    assert "residual_force" not in EFFECTS.names()
    assert effect_class("residual_force") is ResidualForce


def drawn(vehicle, inputs, seed=0):
    make = np.random.default_rng(seed)
    values = {}
    for p in ResidualForce.describe(vehicle, "wrench", inputs):
        value = p.scale * make.normal()
        values[p.name] = abs(value) if p.low == 0 else value
    return values


def test_what_depends_on_velocity_takes_power_in_every_degree_of_freedom():
    vehicle = example_vehicle()
    scene = make_scene(vehicle, "wrench", runs=200)
    row = scene.inputs.each()[0]
    values = drawn(vehicle, ["velocity"])
    model = GreyBox(vehicle, [ResidualForce.build(vehicle, "wrench", values)], actuation="wrench")
    still = torch.eye(3, dtype=torch.float64).expand(200, 3, 3)
    with torch.no_grad():
        terms = model.wrenches(scene.eta[:, :3], still, scene.nu, row.command, row, scene.times[0])
    assert (terms["residual_force"] * scene.nu < 0).all()
    with pytest.raises(ConfigError, match="out of bounds"):
        ResidualForce.build(vehicle, "wrench", {"X_u_1": -1.0})


@pytest.mark.parametrize("inputs", [["tilt"], ["velocity", "command"], list(INPUTS)])
def test_it_depends_on_the_inputs_that_were_chosen_and_on_no_other(inputs):
    vehicle = plain_vehicle()
    effect = ResidualForce.build(vehicle, "wrench", drawn(vehicle, inputs))
    assert list(effect.inputs) == inputs
    model = GreyBox(vehicle, [effect], actuation="wrench")
    point = {
        "velocity": torch.tensor([0.3, -0.2, 0.1, 0.2, 0.1, -0.3]).double(),
        "heading": torch.tensor(0.4).double(),
        "tilt": torch.tensor([0.1, -0.2]).double(),
        "command": torch.tensor([20.0, 5, -4, 1, 2, 3]).double(),
    }

    def force(**other):
        at = {**point, **other}
        from auvnn.models.inputs import Inputs
        from auvnn.physics.attitude import euler_to_quat, quat_to_matrix

        euler = torch.cat([at["tilt"], at["heading"].reshape(1)])
        rotation = quat_to_matrix(euler_to_quat(euler))
        inputs = Inputs(at["command"])
        place = torch.zeros(3).double()
        terms = model.wrenches(place, rotation, at["velocity"], at["command"], inputs, place[0])
        return terms["residual_force"]

    for name in INPUTS:
        moved = force(**{name: point[name] + 0.2})
        # Pitching turns the nose's direction too: the heading's cosine and sine are those of the nose.
        depends = name in inputs or (name == "tilt" and "heading" in inputs)
        assert (not torch.allclose(moved, force(), rtol=1e-9)) == depends, name


def test_a_saved_model_keeps_choice_and_weights(tmp_path):
    vehicle = plain_vehicle()
    values = drawn(vehicle, ["tilt", "command"])
    effect = ResidualForce.build(vehicle, "wrench", values)
    GreyBox(vehicle, [effect], actuation="wrench").save(tmp_path / "model")
    back = load(tmp_path / "model").effect("residual_force")
    assert back.values() == values and back.inputs == ("tilt", "command")


def test_an_input_that_there_is_not_is_refused():
    with pytest.raises(ConfigError, match=r"no input.*'colour'.*velocity, tilt"):
        ResidualForce.build(plain_vehicle(), "wrench", inputs=["colour"])


def test_it_says_which_inputs_count():
    effect = ResidualForce.build(plain_vehicle(), "wrench", {"X_u_1": 3.0, "N_tilt_x_2": 0.1})
    assert next(iter(effect.shares())) == "u" and sum(effect.shares().values()) == pytest.approx(1)
    assert "uses u " in effect.words() and "heading" not in effect.words()
