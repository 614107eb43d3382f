"""Drag that grows with time."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class Biofouling(Effect):
    """All drag grows in proportion to time: D(nu_r) nu_r <- (1 + rate t) D(nu_r) nu_r, t on the log's clock.

    It takes everything that resists motion through the water, learned damping included. Growth takes weeks;
    what a single dive can show is weed, a sail of nylon or a dragged line, which grow faster.
    Reference: Schultz, Walker, Steppe and Flemming (2015), Biofouling 31; Anderlini et al. (2021), IEEE JOE.
    """

    name = "biofouling"
    cause = "drag grows with time"
    symbol = "k_f"
    reference = "Schultz et al. (2015), Biofouling 31; Anderlini et al. (2021), IEEE JOE"
    confused_with = ("voltage_droop", "quadratic_damping", "tether")
    manoeuvre = "coast_down"
    told_apart_by = "the same coast-down repeated early and late"
    plainer = ("quadratic_damping",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the growth of the drag, as a share of it."""
        return (Parameter("rate", "1/s", 0.0, 2e-3, 0.0, 1.0),)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the drag that has been added."""
        assert moment.drag is not None
        grown = self.theta[0].to(moment.nu) * moment.time.to(moment.nu)
        return grown.unsqueeze(-1) * moment.drag
