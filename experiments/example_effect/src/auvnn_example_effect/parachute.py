"""A drag parachute that is towed on a line."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects import Body, Effect, Moment, Parameter


class Parachute(Effect):
    """A parachute at r pulls against the motion of that point through the water.

    With v_P = v_r + omega x r: F = -drag |v_P| v_P at r, tau = [F; r x F], drag = 1/2 rho C_d A.
    Reference: Hoerner (1965), Fluid-Dynamic Drag, chapter 13.
    """

    name = "parachute"
    cause = "a parachute is towed"
    symbol = "C_d A"
    reference = "Hoerner (1965), Fluid-Dynamic Drag, chapter 13"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the drag, and where the line is made fast: at the stern, half a length aft, as a rule.

        The place is a shape: it has no meaning while there is no drag.
        """
        length, density = float(vehicle.length), float(vehicle.water_density)
        drag = 0.05 * density * length**2
        return (
            Parameter("drag", "N s2/m2", 0.0, drag, 0.0, 100 * drag),
            Parameter("x", "m", -0.5 * length, 0.3 * length, -3 * length, 3 * length, shape=True),
        )

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the pull of the line."""
        drag, x = self.theta.to(moment.nu).unbind(-1)
        zero = torch.zeros_like(x)
        place = torch.stack([x, zero, zero]).expand_as(moment.nu_r[..., :3])
        local = moment.nu_r[..., :3] + torch.linalg.cross(moment.nu_r[..., 3:], place)
        # At rest the slope of |v| v is zero; the tiny number keeps the square root's from being infinite.
        speed = torch.sqrt((local * local).sum(-1, keepdim=True) + 1e-30)
        force = -drag * speed * local
        return torch.cat([force, torch.linalg.cross(place, force)], dim=-1)
