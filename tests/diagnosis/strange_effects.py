"""Effects that no catalogue has: what nobody can name, what looks like another, what needs a missing sensor."""

from __future__ import annotations

from typing import ClassVar

import torch
from torch import Tensor

from auvnn.effects import Body, Effect, Moment, Parameter


class _Force(Effect):
    """A force of one size along one body axis."""

    cause = "made up for a test"
    symbol = "F"
    reference = "none"
    axis: ClassVar[int] = 0
    typical: ClassVar[float] = 10.0

    @classmethod
    def describe(cls, vehicle, actuation):
        return (Parameter("force", "N", 0.0, cls.typical, -500.0, 500.0),)

    def shape(self, moment: Moment) -> Tensor:
        return torch.ones_like(moment.nu[..., 0])

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        unit = torch.zeros(6, dtype=moment.nu.dtype)
        unit[self.axis] = 1.0
        return self.theta[0].to(moment.nu) * self.shape(moment).unsqueeze(-1) * unit


class HeadingForce(_Force):
    """A sway force that changes with twice the heading, which no effect of the catalogue does."""

    name = "heading_force"
    axis = 1

    def shape(self, moment: Moment) -> Tensor:
        return torch.sin(2 * torch.atan2(moment.rotation[..., 1, 0], moment.rotation[..., 0, 0]))


class ClockForce(_Force):
    """A surge force that beats with the clock and with nothing that is measured."""

    name = "clock_force"

    def shape(self, moment: Moment) -> Tensor:
        return torch.cos(3 * moment.time).expand(moment.nu.shape[:-1])


class HeavePush(_Force):
    """A force along the body's vertical: on a level vehicle, too much buoyancy with the sign turned."""

    name = "heave_push"
    axis = 2
    typical = 9.81


class BottomPull(_Force):
    """A force that needs an altimeter."""

    name = "bottom_pull"
    channels = ("altitude", "voltage")
    axis = 2


def listed(monkeypatch, *kinds: type[Effect]) -> None:
    """Put effects into the catalogue for the length of a test."""
    from auvnn.effects import EFFECTS

    for kind in kinds:
        monkeypatch.setitem(EFFECTS._table, kind.name, f"{__name__}:{kind.__name__}")
