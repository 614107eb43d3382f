"""Sensitivities of free runs against central differences of the free runs themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from torch.func import functional_call, vmap

from auvnn.effects import EFFECTS
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.estimation.propagation import _terms
from auvnn.estimation.sensitivity import respond
from auvnn.estimation.window_simulation import output_error
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import ACCELERATION, POSITION, cut_windows
from auvnn.models import GreyBox, Inputs
from auvnn.testing import example_vehicle
from auvnn.testing.scene import typical_values
from tests.small_logs import make_log, small_vehicle

# A smaller perturbation loses digits, a larger one bends: in units of the parameters' plausible departures.
STEP = 1e-4
# Second order in the time step: positions after ten steps are good to a few per cent, see the test of the order.
CLOSE = 0.03


@pytest.fixture(scope="module")
def model():
    """A model with every effect of the catalogue away from its null, and the uncertain inertia."""
    vehicle = small_vehicle(buoyancy=495.0)
    values = {n: typical_values(EFFECTS.get(n), vehicle, "thrusters", 0.3) for n in EFFECTS.names()}
    return GreyBox(vehicle).with_effects({**values, "inertia": {"K": 1.1, "M": 0.9, "N": 1.2}})


def by_differences(model, windows, initial, names):
    """Return changes of the predictions with initial states (B, L, 18, 12) and parameters (B, L, 18, P)."""
    count = len(windows)
    change = torch.zeros(24, count, 12, dtype=torch.float64)
    for i in range(12):
        change[i, :, i], change[12 + i, :, i] = STEP, -STEP
    many = windows.pick(np.tile(np.arange(count), 24))
    error = output_error(model, many, moved(initial.repeat(24, 1), change.flatten(0, 1)))
    error = error.reshape(2, 12, count, *error.shape[1:])
    # The error is measured minus predicted: its change is that of the prediction, turned around.
    states = ((error[1] - error[0]) / (2 * STEP)).movedim(0, -1)
    theta = torch.as_tensor(parameters_of(model, names))
    scale = torch.tensor([p.scale for n in names for p in model.effect(n).parameters_of], dtype=theta.dtype)
    step = STEP * torch.diag(scale)
    ends = varied(model, windows, initial, names, torch.cat([theta + step, theta - step]))
    ends = ends.reshape(2, len(theta), *ends.shape[1:])
    parameters = (ends[1] - ends[0]) / (2 * STEP * scale[:, None, None, None])
    return states, parameters.movedim(0, -1)


class Error(torch.nn.Module):
    """What `output_error` says, as a function of the model's parameters."""

    def __init__(self, model, windows, initial):
        super().__init__()
        self.model, self.asked = model, (windows, initial)

    def forward(self):
        return output_error(self.model, *self.asked)


def varied(model, windows, initial, names, thetas):
    """Return the errors with each of some values of all parameters, (M, B, L, 18), by one run of all of them."""
    counts = [len(model.effect(n).parameters_of) for n in names]
    parts = {
        f"model.effects.{model.effect_names.index(n)}.theta": part
        for n, part in zip(names, thetas.split(counts, -1), strict=True)
    }
    error = Error(model, windows, initial)
    found = vmap(lambda values: functional_call(error, values))(parts)
    # That they are runs with these values and no others one of them shows, run by itself.
    other = model.rebuilt(model.copied_effects())
    set_parameters(other, names, thetas[-1].numpy())
    torch.testing.assert_close(found[-1], output_error(other, windows, initial))
    return found


def gap(found, expected):
    """Return by output and cause the largest error over the largest change of outputs of that kind."""
    told = found.shape[2]
    # Of channels that nobody measured nothing is told, and there is nothing.
    assert told == 18 or (told == 12 and not expected[:, :, told:].any())
    expected = expected[:, :, :told]
    size = expected.abs().amax((0, 1))
    for block in (slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12), slice(12, 15), slice(15, 18))[
        : told // 3
    ]:
        size[block] = size[block].amax(0, keepdim=True)
    return ((found - expected).abs().amax((0, 1)) / (size + 1e-6 * float(size.max()))).numpy()


@pytest.mark.parametrize(("accelerations", "uneven"), [(True, 0.0), (False, 0.6)])
def test_sensitivities_to_all_effects_at_once_and_to_the_start(model, accelerations, uneven):
    names = model.effect_names
    assert set(EFFECTS.names()) <= set(names)
    # So many effects at once make for a quick vehicle: the steps must be shorter than one effect would need.
    # Each command has either sign while it lasts.
    size = model.actuators.size
    command = 0.4 * np.sin(9.0 * np.arange(43)[:, None] / 60.0 + 2.0 * np.pi * np.arange(size) / size)
    log = make_log(
        model, runs=1, duration=0.7, rate=60.0, accelerations=accelerations, uneven=uneven, command=command
    )
    windows = cut_windows(log, 0.25, 0.4, warmup=0.2)
    initial = initial_states(model, windows)
    found = respond(model, windows, initial, names)
    labels = [f"{n}.{p.name}" for n in names for p in model.effect(n).parameters_of]
    states, parameters = by_differences(model, windows, initial, names)
    assert found.parameters.shape[-1] == len(labels) and len(found.state) == len(states)
    assert found.state.shape[2] == (18 if accelerations else 12)
    assert gap(found.state, states).max() < CLOSE
    worst = dict(zip(labels, gap(found.parameters, parameters).max(0), strict=True))
    assert {n: w for n, w in worst.items() if w > CLOSE} == {}
    parameters = found.parameters
    # Nothing of this may be trivial: every parameter moves some output, but for those of effects that this vehicle or
    # log has nothing for, and for a moment or a shape.
    kinds = {n: type(model.effect(n)) for n in names}
    unlogged = {"altitude", "voltage"} | (set() if accelerations else {"du", "dv", "dw", "dp", "dq", "dr"})
    absent = {
        n for n, k in kinds.items() if k.lacks(model.vehicle, "thrusters") or unlogged & set(k.channels)
    }
    able = torch.tensor(
        [n not in absent and not p.shape for n in names for p in model.effect(n).parameters_of]
    )
    assert able.sum() > 0.8 * len(labels)
    assert (parameters[..., able].abs().amax((0, 1, 2)) > 1e-6).all()
    assert not accelerations or (parameters[..., ACCELERATION, able].abs().amax((0, 1, 2)) > 0).all()
    torch.testing.assert_close(found.error, output_error(model, windows, initial))


def test_the_error_of_the_sensitivities_falls_with_the_square_of_the_step():
    """The same held commands, written down twice as often, so that the motion is the same."""
    model = GreyBox(small_vehicle()).with_effects(
        {"ocean_current": {"v_north": 0.2}, "quadratic_damping": {"X": 1.2}}
    )
    names, errors = model.effect_names, []
    slow = make_log(model, runs=1, duration=1.6, rate=10.0).runs[0]
    for factor in (1, 2):
        t = np.arange(16 * factor + 1) / (10 * factor)
        commands = np.repeat(slow.thrusters, factor, axis=0)[: len(t)]
        start = {
            "quaternion": np.tile(slow.quaternion[0], (len(t), 1)),
            "nu": np.tile(slow.nu[0], (len(t), 1)),
        }
        windows = cut_windows(Log.from_runs([Run(0, t, **start, thrusters=commands)]), 1.6)
        initial = initial_states(model, windows)
        found = respond(model, windows, initial, names)
        states, parameters = by_differences(model, windows, initial, names)
        # Velocities alone: the attitude's error is not small here, so its logarithm is bent.
        both = torch.cat([found.state, found.parameters], -1)[0, -1, 6:12]
        errors.append(float((both - torch.cat([states, parameters], -1)[0, -1, 6:12]).norm()))
    assert 3.0 < errors[0] / errors[1] < 5.5


def test_a_commanded_wrench_with_full_matrices_elements_and_fins():
    model = GreyBox(example_vehicle(), actuation="wrench").with_effects(
        {"thruster_gain": {"X": 1.2}, "thruster_lag": {"time_constant": 0.1}, "net_buoyancy": {"force": 5.0}}
    )
    t = np.arange(0, 0.61, 0.025)
    random = np.random.default_rng(1)
    wrench = random.uniform(-1, 1, (len(t), 6)) * [30, 30, 30, 3, 3, 3]
    fins = random.uniform(-0.3, 0.3, (len(t), 2))
    start = torch.tensor([[0, 0, 5.0, 0.1, -0.2, 0.5], [0.8, 0.2, -0.1, 0.1, 0.2, -0.3]], dtype=torch.float64)
    with torch.no_grad():
        run = model.rollout(*start, Inputs(torch.tensor(wrench), torch.tensor(fins)), torch.tensor(t))
    log = Log.from_runs(
        [
            Run(
                0,
                t,
                run.eta[:, 3:].numpy(),
                run.nu.numpy(),
                position=run.eta[:, :3].numpy(),
                wrench=wrench,
                fins=fins,
            )
        ]
    )
    windows = cut_windows(log, 0.6)
    initial = initial_states(model, windows)
    names = model.effect_names
    found = respond(model, windows, initial, names)
    states, parameters = by_differences(model, windows, initial, names)
    assert gap(found.state, states).max() < CLOSE
    assert gap(found.parameters, parameters).max() < CLOSE


def test_only_the_named_effects_have_columns_in_the_order_named(model):
    windows = cut_windows(make_log(model, runs=1, duration=1.0, rate=20.0), 0.5)
    initial = initial_states(model, windows)
    both = respond(model, windows, initial, ["thruster_lag", "ocean_current"])
    one = respond(model, windows, initial, ["ocean_current"])
    none = respond(model, windows, initial, [])
    assert both.parameters.shape[-1] == 4 and none.parameters.shape[-1] == 0
    torch.testing.assert_close(both.parameters[..., 1:], one.parameters)
    torch.testing.assert_close(none.state, one.state)
    small = respond(model, windows, initial, ["thruster_lag", "ocean_current"], chunk=7)
    torch.testing.assert_close(small.parameters, both.parameters)


def test_what_was_not_measured_has_neither_error_nor_slope():
    model = GreyBox(small_vehicle()).with_effects(["ocean_current"])
    run = make_log(GreyBox(small_vehicle()), runs=1, duration=2.0).runs[0]
    nu = run.nu.copy()
    nu[5, 3] = np.nan
    log = Log.from_runs([Run(0, run.t, run.quaternion, nu, thrusters=run.thrusters)])
    windows = cut_windows(log, 2.0)
    found = respond(model, windows, initial_states(model, windows), ["ocean_current"])
    assert not found.error[..., POSITION].any() and not found.error[..., ACCELERATION].any()
    assert not found.state[..., POSITION, :].any() and not found.parameters[..., POSITION, :].any()
    assert found.state.shape[2] == found.parameters.shape[2] == 12
    assert found.error[0, 5, 9] == 0 and not found.parameters[0, 5, 9].any()
    assert found.parameters[0, 6, 6].abs().max() > 0 and bool(torch.isfinite(found.error).all())


@pytest.mark.parametrize("norm", [1e-3, 0.03, 0.2, 0.5])
def test_the_series_has_as_many_terms_as_a_step_needs(norm):
    """Of (exp(x) - 1)/x, summed up to and without the terms that are left out."""
    kept = sum(norm**k / math.factorial(k + 1) for k in range(_terms(norm)))
    assert abs(kept - math.expm1(norm) / norm) < 3e-7
    assert _terms(norm) <= _terms(2.0 * norm) <= 8
