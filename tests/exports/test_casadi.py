"""CasADi: the functions equal the model, its own derivatives ours, and a controller drives a vehicle with them."""

from __future__ import annotations

import builtins

import numpy as np
import pytest
import torch

from auvnn.errors import MissingExtra
from auvnn.exports import export
from auvnn.exports.system import System
from tests.exports.cases import OTHERS, VEHICLES, differs, model

ca = pytest.importorskip("casadi")


def columns(a, names):
    return [np.atleast_2d(a[n].numpy().T) for n in names]


@pytest.mark.parametrize("name", [*VEHICLES, *OTHERS])
def test_the_functions_are_the_model(tmp_path, name):
    own = model(name)
    out = export(own, "casadi", tmp_path / "out")
    assert out.lost == ()
    system = System(own, 0.05)
    rate, step, jacobian = (
        ca.Function.load(str(tmp_path / "out" / f"{system.name}_{n}.casadi"))
        for n in ("rate", "step", "jacobian")
    )
    a = system.samples(1000, seed=21)
    with torch.no_grad():
        expected = system.flow.rate(a["x"], a["u"], a["t"])
        after = system.steps.step(a["s"], a["u"], a["t"], a["h"])
    assert differs(np.array(rate(*columns(a, "xut"))).T, expected) < 1e-12
    assert differs(np.array(step(*columns(a, "suth"))).T, after) < 1e-12
    # Its automatic differentiation, ours in the file, and torch's: three ways to the same slopes.
    x, u, t = ca.SX.sym("x", system.flow.size), ca.SX.sym("u", system.flow.inputs), ca.SX.sym("t")
    by_casadi = ca.Function("j", [x, u, t], [ca.jacobian(rate(x, u, t), x)])
    inputs = system.flow.split(a["u"][:20])
    given = {"fins": inputs.fins, "voltage": inputs.voltage, "altitude": inputs.altitude}
    slopes = own.linearise(a["x"][:20], inputs.command, time=a["t"][:20], **given).A.numpy()
    for k in range(20):
        at = [a[n][k].numpy() for n in "xut"]
        for found in (by_casadi(*at), jacobian(*at)[0]):
            assert np.abs(np.array(found) - slopes[k]).max() < 1e-10 * np.abs(slopes[k]).max()


@pytest.mark.long
def test_a_controller_drives_the_vehicle_to_a_point(tmp_path):
    """Nonlinear model predictive control over 3 s with ipopt: two metres and a quarter turn within 12 s."""
    own = model("bluerov2_heavy")
    export(own, "casadi", tmp_path / "out")
    step = ca.Function.load(str(tmp_path / "out" / "bluerov2_heavy_step.casadi"))
    horizon, dt, n, m = 12, 0.25, 13, 8
    opti = ca.Opti()
    x, u = opti.variable(n, horizon + 1), opti.variable(m, horizon)
    start, goal = opti.parameter(n), opti.parameter(7)
    cost = 0
    for k in range(horizon):
        # Two steps of the integrator to each of the controller.
        middle = step(x[:, k], u[:, k], 0, dt / 2)
        opti.subject_to(x[:, k + 1] == step(middle, u[:, k], 0, dt / 2))
        place = x[:3, k + 1] - goal[:3]
        turn = 1 - ca.dot(x[3:7, k + 1], goal[3:]) ** 2
        cost += (
            ca.dot(place, place)
            + 2 * turn
            + 0.3 * ca.dot(x[7:, k + 1], x[7:, k + 1])
            + 0.05 * ca.dot(u[:, k], u[:, k])
        )
    opti.minimize(cost)
    opti.subject_to(x[:, 0] == start)
    opti.subject_to(opti.bounded(-0.9, ca.vec(u), 0.9))
    opti.solver(
        "ipopt", {"print_time": False, "expand": True}, {"print_level": 0, "max_iter": 80, "tol": 1e-4}
    )
    state = torch.tensor([0, 0, 5.0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0], dtype=torch.float64)
    target = np.array([1.5, -1.0, 5.8, np.cos(np.pi / 4), 0, 0, np.sin(np.pi / 4)])
    opti.set_value(goal, target)
    opti.set_initial(x, np.tile(state.numpy()[:, None], horizon + 1))
    for _ in range(48):
        opti.set_value(start, state.numpy())
        solution = opti.solve_limited()
        plan, command = solution.value(x), solution.value(u)
        # The vehicle itself is the model, as auvnn integrates it.
        with torch.no_grad():
            state = own.discrete_step(state, torch.tensor(command[:, 0]), dt)
        opti.set_initial(x, np.concatenate([plan[:, 1:], plan[:, -1:]], axis=1))
        opti.set_initial(u, np.concatenate([command[:, 1:], command[:, -1:]], axis=1))
    assert np.abs(state[:3].numpy() - target[:3]).max() < 0.05
    assert 2 * np.arccos(min(1.0, abs(float(state[3:7].numpy() @ target[3:])))) < 0.05
    assert float(state[7:].abs().max()) < 0.05


def test_a_missing_package_is_said_in_one_line(monkeypatch, tmp_path):
    true = builtins.__import__

    def without(name, *rest):
        if name == "casadi":
            raise ImportError(name)
        return true(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingExtra, match=r"pip install 'auvnn\[casadi\]'"):
        export(model("rov90"), "casadi", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
