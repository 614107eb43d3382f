"""Thrust that is larger at first and falls back to its settled value as the flow develops."""

from __future__ import annotations

from typing import Any, ClassVar

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.factors import actuators
from auvnn.effects.first_order import row_lengths
from auvnn.effects.hooks import EACH, Parameter
from auvnn.physics.recurrence import closing_gap


class ThrustOvershoot(Effect):
    """A demand counts more while it is new: c <- c + excess (c - s), time_constant ds/dt = c - s.

    A thruster that speeds up in water at rest gives more than later, when its own jet has set the water around
    it (in a tank: all the water) in motion; after a change of demand the settled value is reached with the
    time constant of that flow. An excess of -1 would be a plain lag. The excess acts on the command, before the
    thruster curves; where the wrench is commanded, on the force itself. Within a row its mean is used.
    Reference: Healey, Rock, Cody, Miles and Brown (1995), IEEE JOE 20(4).
    """

    name = "thrust_overshoot"
    cause = "thrust is larger at first and falls back as the flow develops"
    symbol = "kappa_T"
    reference = "Healey, Rock, Cody, Miles and Brown (1995), IEEE JOE 20(4)"
    confused_with = ("thruster_lag", "propeller_lag", "added_mass")
    manoeuvre = "pulses"
    told_apart_by = "steps from rest, held for several seconds"
    plainer = ("thruster_lag", "propeller_lag")
    contains: ClassVar = {"thruster_lag": ("time_constant",), "propeller_lag": ("time_constant",)}
    remembers = True

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the excess of each actuator, a share of the change of demand, and the time in which it fades."""
        return (
            Parameter("time_constant", "s", 1.0, 0.5, 0.05, 30.0, actuator=EACH),
            *(
                Parameter(n, "1", 0.0, 0.5, -1.0, 20.0, probes=(0.5,), actuator=i)
                for i, n in enumerate(actuators(vehicle, actuation))
            ),
        )

    def command(self, command: Tensor, times: Tensor) -> Tensor:
        """Add the excess; the flow is taken as settled at the first row."""
        tau, excess = self.theta[0].to(command), self.theta[1:].to(command)
        ratio = row_lengths(times) / tau
        # The flow follows the held commands by first-order filtering, exactly.
        gap = closing_gap(command, torch.exp(-ratio[..., :-1, :]))
        return command - excess * gap * _left(ratio)

    def follow(self, state: Tensor, command: Tensor) -> tuple[Tensor, Tensor]:
        """Return the command with its excess, and ds/dt."""
        tau, excess = self.theta[0].to(command), self.theta[1:].to(command)
        return command + excess * (command - state), (command - state) / tau

    def advance(self, state: Tensor, command: Tensor, step: Tensor) -> tuple[Tensor, Tensor]:
        """Return the command with its mean excess over the step, and s at its end."""
        ratio, excess = step / self.theta[0].to(command), self.theta[1:].to(command)
        gap = command - state
        return command + excess * gap * _left(ratio), command - gap * torch.exp(-ratio)


def _left(ratio: Tensor) -> Tensor:
    """Return the share of the gap that is left on average over a row of so many time constants; one for no length."""
    return torch.where(ratio > 1e-6, -torch.expm1(-ratio) / torch.clamp(ratio, min=1e-6), 1 - ratio / 2)
