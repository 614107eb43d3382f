"""The package's own model as the plant: free-running under commands, or step by step under a controller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.effects import Moment, Sensed
from auvnn.models import GreyBox, Inputs, Trajectory
from auvnn.models.actuation.thrust_signal import ThrustSignal
from auvnn.models.free_running.rollout import LIMIT, steps_per_interval
from auvnn.physics.attitude import quat_derivative, quat_to_matrix
from auvnn.plants.base import Controller, Look, Motion, Plant, PlantTask, diverged, refuse, refuse_laws
from auvnn.plants.beside_thrust import BesideThrust

Array = NDArray[np.float64]

# Steps from which machine code is worth its compiling.
WORTH_COMPILING = 1000

# What the sensors make of row k: position, quaternion and nu, reported and noisy.
Seen = Callable[[int, Sensed], tuple[Array, Array, Array]]


class Start(Protocol):
    """What runs begin with and are told to do; a `Task` and an excitation's `Plan` both are such."""

    @property
    def eta0(self) -> Array: ...  # noqa: D102

    @property
    def nu0(self) -> Array: ...  # noqa: D102

    @property
    def command(self) -> Array | None: ...  # noqa: D102

    @property
    def fins(self) -> Array | None: ...  # noqa: D102

    @property
    def under_way(self) -> bool: ...  # noqa: D102


class OwnPlant(Plant):
    """The model itself, integrated by RK4 with a fixed step, actuators in closed form.

    What it hides is computed by the code that is to explain it: right for teaching and for checking the
    estimation, no proof of the physics.
    """

    name = "own"

    def refuses(self, effect: str) -> str:
        """Return why it cannot hold a stranger; it knows every effect of the catalogue."""
        return (
            "it holds the catalogue's effects only; use plant=numpy" if effect.startswith("stranger_") else ""
        )

    def move(self, task: PlantTask, look: Look) -> Motion:
        """Run the model."""
        refuse(self, task.strangers)
        refuse_laws(self, task)
        model: GreyBox = task.model
        with torch.inference_mode():
            t = torch.tensor(task.t)
            voltage = None if task.voltage is None else torch.tensor(task.voltage)
            if task.controller is None:
                run, inputs = open_loop(model, task, voltage, t, task.max_step)
            else:

                def seen(k: int, sensed: Sensed) -> tuple[Array, Array, Array]:
                    return look(k, sensed.position.numpy(), sensed.quaternion.numpy(), sensed.nu.numpy())

                run, inputs = closed_loop(model, task, task.controller, seen, voltage, t, task.max_step)
            position, quaternion = run.eta[..., :3], run.eta[..., 3:]
            times = run.times.expand(run.nu.shape[:-1])
            rate = model.nu_dot(position, quat_to_matrix(quaternion), run.nu, run.acting, inputs, times)
            sensed = model.sense(Sensed(position, quaternion, run.nu, rate))
        assert sensed.nu_dot is not None
        fins = None if inputs.fins is None else inputs.fins.numpy()
        return Motion(
            run.eta.numpy(), run.nu.numpy(), rate.numpy(), sensed.position.numpy(), sensed.quaternion.numpy(),
            sensed.nu.numpy(), sensed.nu_dot.numpy(), inputs.command.numpy(), fins,
        )  # fmt: skip


def open_loop(plant: GreyBox, plan: Start, voltage: Tensor | None, t: Tensor, max_step: float
              ) -> tuple[Trajectory, Inputs]:  # fmt: skip
    """Run the plant under the plan's commands.

    Args:
        plant: the model with what is hidden.
        plan: starts and commands.
        voltage: V, (R, T), or None.
        t: times of the rows, s, (T,).
        max_step: longest step of the integrator, s.

    Raises:
        AuvnnError: it diverges.
    """
    assert plan.command is not None
    fins = None if plan.fins is None else torch.tensor(plan.fins)
    inputs = Inputs(torch.tensor(plan.command), fins, voltage)
    # A log is the same to the last bit for the same seed, whatever has been compiled before: how it is run depends
    # on how long it is alone.
    steps = steps_per_interval(t, max_step) * (t.shape[-1] - 1)
    engine = "firm" if steps >= WORTH_COMPILING else "torch"
    nu0 = _first_velocity(plant, plan)
    run = plant.rollout(torch.tensor(plan.eta0), nu0, inputs, t, max_step=max_step, engine=engine)
    if run.divergences:
        first = run.divergences[0]
        raise diverged(plant.vehicle.name, first.index, first.time, first.term)
    return run, inputs


def closed_loop(
    plant: GreyBox, plan: Start, controller: Controller, look: Seen, voltage: Tensor | None, t: Tensor,
    max_step: float,
) -> tuple[Trajectory, Inputs]:  # fmt: skip
    """Run the plant under a controller that sees only what the sensors report, all runs at once.

    Each row: look, decide, hold the commands until the next row, as a sampled controller does.

    Args:
        plant: the model with what is hidden.
        plan: starts.
        controller: makes commands of what is seen.
        look: what it sees of a row.
        voltage: V, (R, T), or None.
        t: times of the rows, s, (T,).
        max_step: longest step of the integrator, s.

    Raises:
        AuvnnError: it diverges.
    """
    stepper = Stepper(plant, torch.tensor(plan.eta0), _first_velocity(plant, plan), t, voltage, max_step)
    for k in range(len(t)):
        state = plant.sense(Sensed(stepper.position, stepper.quaternion, stepper.nu))
        command, fins = controller(k, *look(k, state))
        stepper.hold(torch.tensor(command), None if fins is None else torch.tensor(fins))
    return stepper.trajectory(), stepper.inputs()


class Stepper:
    """Integrates a model row by row where the commands are not known beforehand; RK4 as in `rollout`.

    Args:
        model: the plant.
        eta0: (R, 7).
        nu0: (R, 6).
        t: (T,), s.
        voltage: (R, T), V, or None.
        max_step: longest step of the integrator, s.
    """

    def __init__(
        self, model: GreyBox, eta0: Tensor, nu0: Tensor, t: Tensor, voltage: Tensor | None, max_step: float
    ) -> None:
        """Begin at the first row."""
        self.model, self.t, self.voltage = model, t, voltage
        self.position, self.quaternion, self.nu = eta0[:, :3], eta0[:, 3:], nu0
        self.prepared = None if model.time_varying else model.prepare()
        self.substeps = steps_per_interval(t, max_step)
        self.commands: list[Tensor] = []
        self.fins: list[Tensor] = []
        self.thrusts: list[Tensor] = []
        self.etas, self.nus = list[Tensor](), list[Tensor]()
        self.lag, self.beside = next(iter(model.using("respond")), None), BesideThrust(model)
        self.delay = max((float(e.delay()) for e in model.using("delay")), default=0.0)
        self.demands: list[Tensor] = []
        self.states: list[Tensor] = []
        self.actual: Tensor | None = None

    def hold(self, command: Tensor, fins: Tensor | None) -> None:
        """Hold commands (R, n) and fin angles (R, m) from this row to the next, and move there."""
        k = len(self.commands)
        self.commands.append(command)
        if fins is not None:
            self.fins.append(fins)
        self.etas.append(torch.cat([self.position, self.quaternion], dim=-1))
        self.nus.append(self.nu)
        demand = self._demand(k)
        if self.actual is None:
            self.actual = demand
        self.demands.append(demand)
        self.states.append(self.actual if self.lag is not None else demand)
        row = Inputs(command, fins, None if self.voltage is None else self.voltage[:, k])
        last = k == len(self.t) - 1
        h = float(self.t[min(k + 1, len(self.t) - 1)] - self.t[min(k, len(self.t) - 2)]) / self.substeps
        for part in range(self.substeps):
            mean, slope, start = demand, None, demand
            if self.lag is not None:
                answer = self.lag.respond(self.actual, demand, torch.full((1,), h, dtype=demand.dtype))
                mean, slope, start = answer.mean, answer.slope, answer.start
            if self.delay > 0:
                mean, slope, start = self._delayed(k, part, h)
            if part == 0:
                self.thrusts.append(start)
            mean, slope = self.beside.append(mean, slope, fins, h, part == 0)
            if last:
                return
            if self.lag is not None:
                self.actual = answer.end
            self._step(mean, slope, row, float(self.t[k]) + part * h, h)
        self._check(k)

    def _delayed(self, k: int, part: int, h: float) -> tuple[Tensor, Tensor, Tensor]:
        """Return mean, rise and starting value of the thrust that was due `delay` seconds ago."""
        times = self.t[: k + 1]
        first = max(int(torch.searchsorted(times, times[k] - self.delay - h)) - 1, 0)
        demand, state = (torch.stack(x[first:], dim=-2) for x in (self.demands, self.states))
        signal = ThrustSignal(demand, state, times[first:], self.lag and self.lag.respond)
        when = (times[k] + part * h - self.delay).expand(*demand.shape[:-2], 1)
        mean, slope = signal.over(when, torch.full_like(when, h), h)
        return mean.squeeze(-2), slope.squeeze(-2), signal.at(when).squeeze(-2)

    def _demand(self, k: int) -> Tensor:
        command = self.commands[k]
        if self.model.using("command"):
            history = torch.stack(self.commands, dim=-2)
            times = self.t[: k + 1].expand(history.shape[:-1])
            self.beside.command(history, times)
            for effect in self.model.using("command"):
                history = effect.command(history, times)
            command = history[..., k, :]
        return self.model.actuators.static(command)

    def _step(self, mean: Tensor, slope: Tensor | None, row: Inputs, begin: float, h: float) -> None:
        start = (self.position, self.quaternion, self.nu)
        rate: tuple[Tensor, ...] = ()
        total: tuple[Tensor, ...] = ()
        for c, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            p, q, v = start if not rate else [y + (c * h) * r for y, r in zip(start, rate, strict=True)]
            rotation = quat_to_matrix(q)
            thrust = mean if slope is None else mean + (c - 0.5) * slope
            time = torch.full(v.shape[:-1], begin + c * h, dtype=v.dtype)
            rate = (
                (rotation @ v[:, :3].unsqueeze(-1)).squeeze(-1),
                quat_derivative(q, v[:, 3:]),
                self.model.nu_dot(p, rotation, v, thrust, row, time, self.prepared),
            )
            total = rate if not total else tuple(a + weight * b for a, b in zip(total, rate, strict=True))
        self.position, q, self.nu = (y + (h / 6.0) * r for y, r in zip(start, total, strict=True))
        self.quaternion = q / torch.linalg.vector_norm(q, dim=-1, keepdim=True)

    def _check(self, k: int) -> None:
        sound = (self.nu.abs().amax(dim=-1) < LIMIT) & torch.isfinite(self.quaternion).all(dim=-1)
        if bool(sound.all()):
            return
        run = int(torch.nonzero(~sound)[0])
        one = slice(run, run + 1)
        eta = self.etas[k][one]
        row = Inputs(
            self.commands[k][one], self.fins[k][one] if self.fins else None,
            None if self.voltage is None else self.voltage[one, k],
        )  # fmt: skip
        time = self.t[k].expand(1)
        terms = self.model.wrenches(
            eta[:, :3], quat_to_matrix(eta[:, 3:]), self.nus[k][one], self.thrusts[k][one], row, time
        )
        worst = max(terms, key=lambda n: float(terms[n].abs().max()))
        raise diverged(self.model.vehicle.name, run, float(self.t[k]), worst)

    def inputs(self) -> Inputs:
        """Return what was held, (R, T, ...)."""
        fins = torch.stack(self.fins, dim=-2) if self.fins else None
        return Inputs(torch.stack(self.commands, dim=-2), fins, self.voltage)

    def trajectory(self) -> Trajectory:
        """Return the motion so far."""
        eta, nu, thrust = (torch.stack(x, dim=-2) for x in (self.etas, self.nus, self.thrusts))
        fins, speeds = self.beside.rows()
        return Trajectory(self.t, eta, nu, thrust, fins=fins, speeds=speeds)


def _first_velocity(plant: GreyBox, plan: Start) -> Tensor:
    nu = torch.tensor(plan.nu0)
    return over_ground(plant, torch.tensor(plan.eta0), nu) if plan.under_way else nu


def over_ground(model: GreyBox, eta: Tensor, nu: Tensor) -> Tensor:
    """Return the velocity over ground at the start of runs, from that through the water, (..., 6).

    Args:
        model: whose water moves.
        eta: (..., 7).
        nu: (..., 6).
    """
    rotation, zero = quat_to_matrix(eta[..., 3:]), torch.zeros_like(nu)
    command = zero[..., :1].expand(*nu.shape[:-1], model.actuators.size)
    moment = Moment(zero[..., 0], eta[..., :3], rotation, zero, zero, zero, command)
    for effect in model.using("water"):
        drift = (rotation.mT @ effect.water(moment)[0].unsqueeze(-1)).squeeze(-1)
        nu = torch.cat([nu[..., :3] + drift, nu[..., 3:]], dim=-1)
    return nu
