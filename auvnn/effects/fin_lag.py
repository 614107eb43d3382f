"""Fins that follow their commanded angle with a first-order lag."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.fin_parts import FinEffect
from auvnn.effects.first_order import TIME_CONSTANT, first_order
from auvnn.effects.hooks import Parameter, Response


class FinLag(FinEffect):
    """First-order lag between commanded and actual fin angles: d delta/dt = (delta_cmd - delta) / time_constant.

    The log's fin angles are then commands; where they are measured at the fin there is nothing to lag behind. Over an
    interval of constant command the solution is exact. All fins have the same time constant, and their servos reach
    any rate. The actual angle begins at the first command of the history: a window within a run is given what was
    commanded before it. At the null (0 s) the slope is the true one.
    Reference: Fossen (2011), section 9.5, steering machine; Prestero (2001) for the vehicle's fins.
    """

    name = "fin_lag"
    cause = "the fins follow their commanded angle with a lag"
    symbol = "tau_delta"
    reference = (
        "Fossen (2011), Handbook of Marine Craft Hydrodynamics and Motion Control, steering machine models"
    )
    confused_with = ("fin_gain", "actuation_delay", "added_mass")
    manoeuvre = "survey"
    told_apart_by = "turns and depth changes that begin and end within a few seconds, at speed"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the time constant."""
        return (TIME_CONSTANT,)

    def steer(self, state: Tensor, command: Tensor, step: Tensor) -> Response:
        """Return the lagged angles; at the null they are the commands themselves, exactly.

        Args:
            state: angles at the start, rad, (..., m).
            command: angles that are asked for, rad, (..., m).
            step: for how long, s, broadcast against both.
        """
        return first_order(self.theta[0], state, command, step)
