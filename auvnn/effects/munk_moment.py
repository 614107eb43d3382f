"""The destabilising moment of the hull at an angle to the flow."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class MunkMoment(Effect):
    """Factors on the Munk moments that the added mass implies: M = (A33 - A11) u w, N = -(A22 - A11) u v.

    Viscous flow at the stern leaves 0.4 to 0.7 of the ideal moment; some simulators drop it. The model's own
    Coriolis terms hold the ideal one, so the wrench is (factor - 1) times it, in the relative velocity. It is
    part of `body_lift`. Reference: Munk (1924); Newman (1977), section 4.13; Fossen (2011), section 6.3.
    """

    name = "munk_moment"
    cause = "the Munk moment is not the ideal one"
    symbol = "k_M"
    reference = "Munk (1924), NACA 184; Newman (1977), section 4.13"
    confused_with = ("body_lift", "added_mass", "added_mass_coriolis")
    manoeuvre = "rotation"
    told_apart_by = "turning at zero speed, then runs at an angle of drift"
    plainer = ("added_mass",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the factors in pitch and yaw."""
        return tuple(Parameter(n, "1", 1.0, 0.4, -5.0, 5.0) for n in ("pitch", "yaw"))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return what is to be added to the ideal moment."""
        u, v, w = moment.nu_r[..., :3].unbind(-1)
        surge, sway, heave = body.added_mass.diagonal(dim1=-2, dim2=-1)[..., :3].unbind(-1)
        pitch, yaw = (self.theta.to(u) - 1).unbind(-1)
        none = torch.zeros_like(u)
        turning = [pitch * (heave - surge) * u * w, -yaw * (sway - surge) * u * v]
        return torch.stack([none, none, none, none, *turning], dim=-1)
