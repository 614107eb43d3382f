"""Propellers whose speed follows its command with a lag."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.first_order import TIME_CONSTANT, first_order, row_lengths
from auvnn.effects.hooks import Parameter
from auvnn.physics.recurrence import closing_gap


class PropellerLag(Effect):
    """First-order lag of a propeller's speed: dn/dt = (n_command - n) / time_constant; the thrust is that of n.

    So simulators have it that integrate the motor's speed and take the thrust from n abs(n). The command stands for the
    speed: the lag acts before the thruster curves. A thrust that grows comes later, and one that shrinks earlier, than by
    a lag of the thrust itself (`thruster_lag`); while the time constant is short beside the changes of the command, the
    two are the same: T(n - tau dn/dt) = T - tau dT/dt. The speed begins settled at the first command of the history.
    Over an interval of constant command the solution is exact. The curves are given its mean there, which misses the
    mean of n abs(n) by the variance of n within the interval. Losses by inflow go by that mean too. At the null (0 s) the
    slope is the true one.
    Reference: Yoerger, Cooke and Slotine (1990), for the propeller's speed as the state of the actuator.
    """

    name = "propeller_lag"
    cause = "the propellers' speed follows its command with a lag"
    symbol = "tau_n"
    reference = "Yoerger, Cooke and Slotine (1990), IEEE JOE 15(3)"
    confused_with = ("thruster_lag", "actuation_delay", "added_mass", "thrust_overshoot")
    manoeuvre = "pulses"
    told_apart_by = "large steps of the command, up and down and through zero"
    plainer = ("thruster_lag",)
    remembers = True
    turns = True

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what the model must be driven by: commands of thrusters. A wrench has no speed before its curve."""
        return () if actuation == "thrusters" else ("commands of thrusters",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the time constant."""
        return (TIME_CONSTANT,)

    def command(self, command: Tensor, times: Tensor) -> Tensor:
        """Return the mean speed of every row as a command; it is settled at the first one.

        Args:
            command: held per interval, (..., T, n).
            times: of the rows, s, (..., T).
        """
        steps = row_lengths(times)
        # The answer is linear in the gap between speed and command: that to a gap of one tells how it closes.
        one = first_order(self.theta[0], torch.ones_like(steps), torch.zeros_like(steps), steps)
        return command + closing_gap(command, one.end[..., :-1, :]) * one.mean

    def follow(self, state: Tensor, command: Tensor) -> tuple[Tensor, Tensor]:
        """Return the speed as a command, and its rate, 1/s.

        Args:
            state: the speed, as the command that it settles at, (..., n).
            command: that is held, (..., n).
        """
        return state, (command - state) / torch.clamp(self.theta[0].to(command), min=1e-6)

    def advance(self, state: Tensor, command: Tensor, step: Tensor) -> tuple[Tensor, Tensor]:
        """Return the mean speed over a step, as a command, and the speed at its end.

        Args:
            state: the speed at its start, (..., n).
            command: that is held, (..., n).
            step: for how long, s, (..., 1).
        """
        answer = first_order(self.theta[0], state, command, step)
        return answer.mean, answer.end
