"""The whole model as a system of first-order equations, actuators included: what estimators and controllers use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

from auvnn.errors import ConfigError
from auvnn.models.actuation.actuator_states import ActuatorStates
from auvnn.models.free_running.rate import SIZE, state_rate, unit_attitude
from auvnn.models.inputs import Inputs
from auvnn.physics.kinematics import eta6_to_eta7

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox

NAMES = ("x", "y", "z", "qw", "qx", "qy", "qz", "u", "v", "w", "p", "q", "r")


class StateSpace(nn.Module):
    """x_dot = f(t, x, u), and x(t + dt) = F(t, x, u) with u held.

    x = [position NED, quaternion (w, x, y, z), nu | what the actuators remember], u = [commands, fin angles, voltage,
    altitude], the last three where the model has a use for them.

    Args:
        model: the model; its parameters are taken as they are now.
        dt: length of the step, s: with it the memory of a delay is that of the step, without it that of continuous time.

    Raises:
        ConfigError: the step is not positive, or an effect cannot be written in this form.
    """

    def __init__(self, model: GreyBox, dt: float | None = None) -> None:
        """Work out what does not change with the state."""
        super().__init__()
        if dt is not None and not 0 < dt < 1e6:
            raise ConfigError(f"dt={dt!r} s: give a positive step")
        self.model, self.dt = model, dt
        self.actuators = ActuatorStates(model.actuators, model.members, dt, len(model.vehicle.fins))
        channels = {c for e in model.members for c in e.channels}
        self.fins = len(model.vehicle.fins)
        self.voltage = "voltage" in channels
        self.altitude = "altitude" in channels and model.bottom is None
        self.prepared = None if model.time_varying else model.prepare()

    @property
    def size(self) -> int:
        """Numbers in x."""
        return SIZE + self.actuators.states

    @property
    def inputs(self) -> int:
        """Numbers in u."""
        return self.actuators.size + self.fins + self.voltage + self.altitude

    def state_names(self) -> list[str]:
        """Return the names of x."""
        return [*NAMES, *self.actuators.names()]

    def input_names(self) -> list[str]:
        """Return the names of u, those of a log's columns."""
        wrench = self.model.actuation == "wrench"
        names = (
            [f"tau_{a}" for a in "XYZKMN"]
            if wrench
            else [f"thruster_{k + 1}" for k in range(self.actuators.size)]
        )
        names += [f"fin_{k + 1}" for k in range(self.fins)]
        return names + ["voltage"] * self.voltage + ["altitude"] * self.altitude

    def split(self, u: Tensor) -> Inputs:
        """Return u (..., m) as inputs of the model."""
        n, m = self.actuators.size, self.actuators.size + self.fins
        return Inputs(
            u[..., :n],
            u[..., n:m] if self.fins else None,
            u[..., m] if self.voltage else None,
            u[..., m + self.voltage] if self.altitude else None,
        )

    def join(
        self, command: Tensor, fins: Tensor | None, voltage: Tensor | None, altitude: Tensor | None
    ) -> Tensor:
        """Return u (..., m) from its parts; fins that are not given are at zero.

        Args:
            command: (..., n).
            fins: fin angles, rad, (..., k), or None.
            voltage: V, (...), or None.
            altitude: m, (...), or None.

        Raises:
            ConfigError: what the model needs is missing, or is of the wrong size.
        """
        n, lead = self.actuators.size, command.shape[:-1]
        if command.shape[-1:] != (n,):
            raise ConfigError(
                f"command {tuple(command.shape)}: the last size is {n} ({self.model.actuation})"
            )
        parts = [command]
        if self.fins:
            fins = command.new_zeros(*lead, self.fins) if fins is None else fins
            if fins.shape[-1:] != (self.fins,):
                raise ConfigError(f"fins {tuple(fins.shape)}: the vehicle has {self.fins} fins")
            parts.append(fins)
        for name, wanted, value in (
            ("voltage", self.voltage, voltage),
            ("altitude", self.altitude, altitude),
        ):
            if wanted and value is None:
                raise ConfigError(f"the model has an effect that needs {name}: give {name}=")
            if wanted and value is not None:
                parts.append(value.unsqueeze(-1))
        lead = torch.broadcast_shapes(*(p.shape[:-1] for p in parts))
        return torch.cat([p.expand(*lead, p.shape[-1]) for p in parts], dim=-1)

    def settled(self, eta: Tensor, nu: Tensor, command: Tensor, fins: Tensor | None = None) -> Tensor:
        """Return x (..., n) with actuators that have been at a command (..., k) for long.

        Args:
            eta: (..., 7), or (..., 6) with Euler angles.
            nu: (..., 6), m/s and rad/s.
            command: (..., k).
            fins: angles at which the fins have been, rad, (..., m); zero where not given.
        """
        if self.actuators.fins:
            fins = command.new_zeros(self.fins) if fins is None else fins
            lead = torch.broadcast_shapes(command.shape[:-1], fins.shape[:-1])
            command = torch.cat([x.expand(*lead, x.shape[-1]) for x in (command, fins)], dim=-1)
        eta = eta6_to_eta7(eta) if eta.shape[-1] == 6 else eta
        own = self.actuators.settled(command)
        lead = torch.broadcast_shapes(eta.shape[:-1], nu.shape[:-1], own.shape[:-1])
        return torch.cat([p.expand(*lead, p.shape[-1]) for p in (eta, nu, own)], dim=-1)

    def motion(self, y: Tensor, thrust: Tensor, u: Tensor, time: Tensor) -> Tensor:
        """Return the rate of position, quaternion and velocity y (..., 13) under a thrust (..., k), N, and fin angles.

        Args:
            y: position, quaternion and velocity, (..., 13).
            thrust: N, (..., k), and after it, where the fins lag, their actual angles, rad.
            u: inputs, (..., m).
            time: s, (...).
        """
        return state_rate(self.model, y, thrust, self.split(u), time, self.prepared)

    def rate(self, x: Tensor, u: Tensor, time: Tensor) -> Tensor:
        """Return f (..., n), for a state space without `dt` or without a delay.

        Args:
            x: state, (..., n).
            u: inputs, (..., m).
            time: s, (...).
        """
        thrust, own = self.actuators.rate(x[..., SIZE:], u[..., : self.actuators.inputs])
        return torch.cat([self.motion(x[..., :SIZE], thrust, u, time), own], dim=-1)

    def step(self, x: Tensor, u: Tensor, time: Tensor, h: Tensor, substeps: int = 1) -> Tensor:
        """Return the state after `h` seconds (...), u held: RK4, with the actuators in closed form.

        With a delay `h` must be `dt`. The same as a rollout over one row whose step is cut into `substeps`.

        Args:
            x: state, (..., n).
            u: inputs held over the step, (..., m).
            time: at its start, s, (...).
            h: its length, s, (...).
            substeps: into how many it is cut.
        """
        y, step = x[..., :SIZE], h.unsqueeze(-1)
        parts, own = self.actuators.advance(x[..., SIZE:], u[..., : self.actuators.inputs], step, substeps)
        part = step / substeps
        for k, (mean, rise) in enumerate(parts):
            begin = time + k * (h / substeps)
            low, high = (mean, mean) if rise is None else (mean - 0.5 * rise, mean + 0.5 * rise)
            k1 = self.motion(y, low, u, begin)
            k2 = self.motion(y + 0.5 * part * k1, mean, u, begin + 0.5 * (h / substeps))
            k3 = self.motion(y + 0.5 * part * k2, mean, u, begin + 0.5 * (h / substeps))
            k4 = self.motion(y + part * k3, high, u, begin + h / substeps)
            y = unit_attitude(y + part / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4))
        return torch.cat([y, own], dim=-1)
