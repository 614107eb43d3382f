"""Whether actuators answer to their own commands alone, where the effects on them say so, and slopes where not."""

from __future__ import annotations

import pytest
import torch
from torch.func import functional_call, jacfwd

import auvnn
from auvnn.effects import EFFECTS, Effect, Parameter
from auvnn.effects.hooks import EACH
from auvnn.estimation.window_simulation import Thrust, simulate_windows, substeps_of
from auvnn.metrics.free_run import initial_states
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.testing.scene import typical_values
from tests.small_logs import make_log, small_vehicle

# Effects on commands, and on how the thrust follows them; that on fins is not among the hooks of this vehicle.
HOOKS = {"command", "delay", "respond"}
ACTING = [n for n in EFFECTS.names() if HOOKS & set(EFFECTS.get(n).hooks())]


class Sagging(Effect):
    """Supply that sags with the sum of all commands: no actuator is by itself."""

    name = "sagging"
    cause = "the supply sags with the sum of all commands"

    @classmethod
    def describe(cls, vehicle, actuation):
        return (Parameter("share", "1", 0.0, 0.1, 0.0, 1.0),)

    def command(self, command, times):
        return command * (1.0 - self.value("share") * command.abs().mean(-1, keepdim=True))


def with_typical(names):
    vehicle = small_vehicle(buoyancy=495.0)
    return GreyBox(vehicle).with_effects(
        {n: typical_values(EFFECTS.get(n), vehicle, "thrusters", 0.3) for n in names}
    )


def windows_of(model):
    log = make_log(GreyBox(model.vehicle), runs=1, duration=20.0, rate=5.0, seed=4)
    return cut_windows(log, 20.0)


@pytest.mark.parametrize("name", ACTING)
def test_no_command_moves_the_thrust_of_another_actuator(name):
    model = with_typical([name])
    assert all(p.actuator is not None for p in model.effects[0].parameters_of)
    windows = windows_of(model)

    def thrust(command):
        drive = model.actuators.drive(command, windows.times[:1], model.before_thrust)
        return torch.cat([drive.means.squeeze(-2), drive.starts], dim=1)[0]

    found = jacfwd(thrust)(windows.inputs.command[:1])[:, :, 0].abs().sum((0, 2))
    assert (found.diagonal() > 0.0).all()
    assert torch.equal(found, torch.diag(found.diagonal()))


@pytest.mark.parametrize("name", ACTING)
def test_a_parameter_of_one_actuator_moves_no_other(name):
    model = with_typical([name])
    windows = windows_of(model)
    slope = by_forward_mode(model, windows, [name])[0].abs().sum((0, 1))
    for k, p in enumerate(model.effects[0].parameters_of):
        moved = [i for i in range(8) if slope[i, k] > 0.0]
        assert moved == (list(range(8)) if p.actuator == EACH else [p.actuator])


def by_forward_mode(model, windows, names):
    """Return changes of the mean thrust and of that as intervals begin with the parameters, (B, L, n, P) each."""
    module, substeps = Thrust(model), substeps_of(windows)
    keys = [f"model.effects.{model.effect_names.index(n)}.theta" for n in names]
    sizes = [model.effect(n).theta.numel() for n in names]

    def thrusts(values):
        return functional_call(module, dict(zip(keys, values.split(sizes), strict=True)), (windows, substeps))

    return jacfwd(thrusts)(torch.cat([model.effect(n).theta.detach() for n in names]))


@pytest.mark.parametrize("own", [[], ["sagging"]], ids=["each by itself", "with one that joins them"])
@pytest.mark.usefixtures("catalogue_as_before")
def test_slopes_of_the_thrust_are_those_of_forward_mode(own):
    auvnn.register_effect(Sagging)
    names = [*own, "thrust_curve", "thrust_overshoot", "actuation_delay"]
    model = with_typical([n for n in names if n not in own]).with_effects({n: {"share": 0.4} for n in own})
    names = model.effect_names
    windows = windows_of(model)
    ran = simulate_windows(model, windows, initial_states(model, windows), names)
    for found, expected in zip(
        (ran.mean_slope, ran.start_slope), by_forward_mode(model, windows, names), strict=True
    ):
        torch.testing.assert_close(found, expected, rtol=1e-10, atol=1e-12)
