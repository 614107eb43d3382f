"""The model as first-order equations: against rollouts, and against differences."""

from __future__ import annotations

import pytest
import torch

from auvnn.damping.bank import DampingBank
from auvnn.effects import Effect
from auvnn.errors import ConfigError
from auvnn.models import GreyBox, Inputs, load
from auvnn.models.actuation.actuator_states import ActuatorStates
from auvnn.models.linear.state_space import StateSpace
from auvnn.physics.kinematics import eta6_to_eta7, eta7_to_eta6
from auvnn.physics.thrusters import summed_table_thrust, table_thrust
from auvnn.testing import example_vehicle
from auvnn.vehicle import load_vehicle

DOUBLE = torch.float64
LAG = {"thruster_lag": {"time_constant": 0.15}}
LATE = {"actuation_delay": {"delay": 0.13}}
TURNING = {"propeller_lag": {"time_constant": 0.2}}
OVER = {"thrust_overshoot": {"time_constant": 0.8, "thruster_1": 0.4, "thruster_3": -0.2}}
MODELS = {
    "plain": {},
    "lag": LAG,
    "delay": LATE,
    "delay of whole steps": {"actuation_delay": {"delay": 0.1}},
    "delay below a step": {"actuation_delay": {"delay": 0.02}},
    "overshoot": OVER,
    "propellers": TURNING,
    "dead band": {"thruster_deadband": {"width": 0.1}},
    "curve": {"thrust_curve": {"thruster_1_positive": 0.8, "thruster_2_negative": 1.3}},
    "polynomial": {"thrust_polynomial": {"thruster_1_degree_2": 0.1, "thruster_2_degree_3": -0.2}},
    "all, in a current": {
        **LAG,
        **LATE,
        **TURNING,
        **OVER,
        "ocean_current": {"v_north": 0.2},
        "flooding": {"rate": 0.02},
    },
}


def built(effects, vehicle="bluerov2_heavy"):
    return GreyBox(load_vehicle(vehicle)).with_effects(effects)


def drawn(model, *batch, seed=0):
    generator = torch.Generator().manual_seed(seed)
    eta = 0.3 * torch.randn(*batch, 6, generator=generator, dtype=DOUBLE)
    eta[..., 2] += 8.0
    nu = 0.4 * torch.randn(*batch, 6, generator=generator, dtype=DOUBLE)
    command = 0.5 * torch.randn(*batch, model.actuators.size, generator=generator, dtype=DOUBLE).clamp(-2, 2)
    return eta, nu, command


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("dt", [0.05, 0.2])
def test_steps_are_the_rows_of_a_rollout(name, dt):
    """Lag, delay and filter included, with steps that the integrator takes whole and such as it cuts."""
    model = built(MODELS[name])
    eta, nu, _ = drawn(model, 3)
    commands = torch.stack([drawn(model, 3, seed=k + 1)[2] for k in range(12)], dim=-2)
    times = dt * torch.arange(12, dtype=DOUBLE)
    run = model.rollout(eta, nu, commands, times, engine="torch")
    with torch.no_grad():
        state = torch.cat([eta6_to_eta7(eta), nu], dim=-1)
        for k in range(11):
            state = model.discrete_step(state, commands[:, k], dt, time=times[k])
            expected = torch.cat([run.eta[:, k + 1], run.nu[:, k + 1]], dim=-1)
            assert float((state[:, :13] - expected).abs().max()) < 1e-11, k


@pytest.mark.parametrize("name", ["lag", "overshoot", "propellers"])
def test_the_continuous_system_is_what_the_steps_follow(name):
    """RK4 of the whole first-order system, finely, against the closed form."""
    model = built(MODELS[name])
    space = StateSpace(model)
    eta, nu, command = drawn(model, 2)
    other = drawn(model, 2, seed=5)[2]
    with torch.no_grad():
        x = space.settled(eta, nu, command)
        u, t, h = space.join(other, None, None, None), torch.zeros(2, dtype=DOUBLE), 0.002
        fine = x
        for _ in range(100):
            k1 = space.rate(fine, u, t)
            k2 = space.rate(fine + h / 2 * k1, u, t)
            k3 = space.rate(fine + h / 2 * k2, u, t)
            k4 = space.rate(fine + h * k3, u, t)
            fine = fine + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        if name == "lag":
            step = model.discrete_step(x, other, 0.2, max_step=0.002)
            assert float((step - fine).abs().max()) < 1e-6
        else:
            # Within a row the mean of excess or speed is used: short rows follow it, the filter itself is exact.
            step, rows = x, 40 if name == "overshoot" else 80
            for _ in range(rows):
                step = model.discrete_step(step, other, 0.2 / rows)
            # Of an exponential RK4 leaves (h/tau)^5 / 120 in each step: 8e-11 where tau is 0.2 s.
            left = 1e-12 if name == "overshoot" else 1e-10
            assert float((step[:, 13:] - fine[:, 13:]).abs().max()) < left
            assert float((step - fine).abs().max()) < 1e-4


def test_a_delay_in_continuous_time_has_the_phase_it_says():
    delay = 0.13
    wrench = GreyBox(load_vehicle("bluerov2_heavy"), actuation="wrench").with_effects(LATE)
    own = ActuatorStates(wrench.actuators, wrench.members)
    with torch.no_grad():
        zero_x, zero_u = torch.zeros(18, dtype=DOUBLE), torch.zeros(6, dtype=DOUBLE)
        a = torch.stack([own.rate(e, zero_u)[1] for e in torch.eye(18, dtype=DOUBLE)], dim=1)
        c = torch.stack([own.rate(e, zero_u)[0] for e in torch.eye(18, dtype=DOUBLE)], dim=1)
        b = torch.stack([own.rate(zero_x, e)[1] for e in torch.eye(6, dtype=DOUBLE)], dim=1)
    for share in (0.5, 1.0, 2.4):
        s = 1j * share / delay
        passed = c.cdouble() @ torch.linalg.solve(s * torch.eye(18) - a, b.cdouble())
        expected = torch.exp(torch.tensor(-s * delay))
        turned = torch.angle(passed[2, 2] / expected)
        assert abs(float(turned)) < 0.0175 and passed[2, 2].abs() > 0.9 - 0.15 * (share > 2)


@pytest.mark.parametrize(
    ("name", "euler"), [("lag", True), ("delay", False), ("dead band", True), ("all, in a current", False)]
)
def test_slopes_are_those_of_differences(name, euler):
    model = built(MODELS[name])
    eta, nu, command = drawn(model, 4)
    # Away from the edges of the thrust tables, where there is no slope.
    command = (command * 20).floor() / 20 + 0.0233
    state = torch.cat([eta if euler else eta6_to_eta7(eta), nu], dim=-1)
    found = model.linearise(state, command, 0.1, time=3.0)
    assert found.A.shape == (4, len(found.states), len(found.states))
    assert found.B_d is not None and found.next is not None and found.A_d is not None
    assert found.B_d.shape == (4, len(found.discrete_states), len(found.inputs))
    with torch.no_grad():
        full = model.discrete_step(state, command, 0.1, time=3.0)
        assert torch.equal(full, found.next)
        for k in range(state.shape[-1]):
            change = torch.zeros_like(state)
            change[..., k] = 1e-6
            # The actuators stay where they are while the state is moved.
            ahead, behind = (model.discrete_step(state + s * change, command, 0.1, time=3.0) for s in (1, -1))
            assert torch.allclose((ahead - behind) / 2e-6, found.A_d[..., k], atol=2e-7, rtol=1e-6)
        for k in range(command.shape[-1]):
            change = torch.zeros_like(command)
            change[..., k] = 1e-6
            start = torch.cat([state, StateSpace(model, 0.1).actuators.settled(command)], dim=-1)
            ahead, behind = (model.discrete_step(start, command + s * change, 0.1, time=3.0) for s in (1, -1))
            assert torch.allclose((ahead - behind) / 2e-6, found.B_d[..., k], atol=1e-6, rtol=1e-5)
        # Continuous and discrete are one system: over a short step one is the other's exponential.
        if "delay" not in " ".join(found.states):
            short = model.linearise(state, command, 1e-5, time=3.0)
            eye = torch.eye(len(found.states), dtype=DOUBLE)
            close = (short.A_d - eye) / 1e-5 - found.A
            if not euler:  # the step makes the quaternion a unit one, which the rate does not
                close = close[..., 7:, :]
            assert float(close.abs().max()) < 2e-3 * max(1.0, float(found.A.abs().max()))


def test_networks_fins_voltage_and_altitude_are_inputs():
    bank = DampingBank.from_description("mlp")
    model = GreyBox(example_vehicle(), (), bank).with_effects(
        {
            "voltage_droop": {"exponent": 1.2},
            "bottom_proximity": {"strength": 0.4},
            "fin_stall": {"factor": 1.5, "separated": 0.6, "sharpness": 0.4, "crossflow": 0.5},
        }
    )
    eta, nu, command = drawn(model, 2)
    given = {"fins": 0.1 * torch.ones(2, 2, dtype=DOUBLE), "voltage": torch.tensor([15.0, 14.0], dtype=DOUBLE),
             "altitude": torch.tensor([2.0, 3.0], dtype=DOUBLE)}  # fmt: skip
    found = model.linearise(torch.cat([eta, nu], dim=-1), command, 0.05, **given)
    assert found.inputs[-4:] == ("fin_1", "fin_2", "voltage", "altitude")
    assert bool((found.B[..., 6:12, -4:].abs().amax((0, 1)) > 1e-6).all())
    twice = [x.unsqueeze(1).repeat(1, 2, *(1,) * (x.dim() - 1)) for x in (command, *given.values())]
    rows = Inputs(*twice)
    run = model.rollout(eta, nu, rows, torch.tensor([0.0, 0.05], dtype=DOUBLE), engine="torch")
    expected = torch.cat([eta7_to_eta6(run.eta[:, 1]), run.nu[:, 1]], dim=-1)
    assert torch.allclose(found.next, expected, atol=1e-12)
    with pytest.raises(ConfigError, match="needs voltage"):
        model.linearise(torch.cat([eta, nu], dim=-1), command, fins=given["fins"], altitude=given["altitude"])


def test_a_state_of_the_wrong_size_is_refused():
    model = load("bluerov2_heavy")
    with pytest.raises(ConfigError, match="13 with a quaternion or 12"):
        model.discrete_step(torch.zeros(11, dtype=DOUBLE), torch.zeros(8, dtype=DOUBLE), 0.1)
    with pytest.raises(ConfigError, match="positive step"):
        model.discrete_step(torch.zeros(12, dtype=DOUBLE), torch.zeros(8, dtype=DOUBLE), 0.0)


def test_steps_can_be_differentiated_through():
    """Of a controller that is trained through the model: gradients over several steps."""
    model = built(LAG)
    eta, nu, command = drawn(model, 2)
    command.requires_grad_()
    state = torch.cat([eta6_to_eta7(eta), nu], dim=-1)
    for _ in range(3):
        state = model.discrete_step(state, command, 0.1)
    slope = torch.autograd.grad(state[..., 0].sum(), command)[0]
    assert bool((slope.abs() > 0).any())


def test_a_table_as_kinks_is_the_table():
    grid = torch.tensor([-1.0, -0.2, 0.1, 0.6, 1.0], dtype=DOUBLE)
    thrust = torch.tensor([-30.0, -2.0, 0.0, 12.0, 38.0], dtype=DOUBLE)
    c = torch.linspace(-1.5, 1.5, 3001, dtype=DOUBLE)
    assert float((summed_table_thrust(c, grid, thrust) - table_thrust(c, grid, thrust)).abs().max()) < 1e-13


def test_an_effect_that_remembers_without_saying_how_is_refused():
    class Forgetful(Effect):
        name, cause, symbol, reference = "forgetful", "", "", ""

        def command(self, command, times):
            return command.cumsum(-2)

    model = load("rov90")
    with pytest.raises(ConfigError, match="forgetful remembers"):
        ActuatorStates(model.actuators, [Forgetful(())])
