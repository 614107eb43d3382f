"""A cable from the vehicle to a fixed point."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Extent, Moment, Parameter
from auvnn.physics.products import cross, matvec

TINY = 1e-12
"""Square of a length, in units of the vehicle's, below which a direction is no longer asked for."""


class Tether(Effect):
    """Pull beyond the slack length, half the cable's weight, and its drag; where it is made fast.

    The cable is fast at r in the body, the origin by default. With d = p + R r - p_anchor and l = |d|, in the world:
    F = -k (1 - slack/l)+ d + [0 0 w l/2], and in the body F = -c l |v| v with v = v_r + omega x r there; the moment
    is r x F. c is drag per metre, about an eighth to a quarter of rho C_n times the diameter.
    The weight is that in water, negative for a buoyant cable. The cable is straight and knows no history.
    Reference: Driscoll, Lueck and Nahon (2000), Applied Ocean Research 22; von Benzon et al. (2022), JMSE 10.
    """

    name = "tether"
    cause = "a cable pulls on the vehicle"
    symbol = "F_t"
    reference = "Driscoll, Lueck and Nahon (2000), Applied Ocean Research 22"
    # Far from its anchor the whole cable is dragged along, and hangs: that is drag and weight of the vehicle. Far below
    # it, each metre of depth adds the weight of half a metre of cable: that is buoyancy that falls with depth.
    confused_with = (
        "ocean_current", "constant_force", "net_buoyancy", "compressibility", "quadratic_damping", "fin_drag",
    )  # fmt: skip
    manoeuvre = "survey"
    told_apart_by = "the same legs at several distances and bearings from the anchor"
    plainer = ("net_buoyancy", "constant_force", "compressibility", "quadratic_damping")
    channels = ("x", "y", "z")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return stiffness, slack, weight, drag, the anchor's place and that in the body; by default both origins."""
        weight = float(vehicle.mass) * float(vehicle.gravity)
        length, density = float(vehicle.length), float(vehicle.water_density)
        stiffness = 0.02 * weight / length
        return (
            Parameter("stiffness", "N/m", 0.0, stiffness, 0.0, 1e3 * stiffness),
            Parameter("slack", "m", 0.0, 5.0 * length, 0.0, 1e4 * length, shape=True, of="stiffness"),
            Parameter("weight", "N/m", 0.0, 2e-3 * weight / length, -weight / length, weight / length),
            Parameter("drag", "N s2/m3", 0.0, 1e-3 * density * length, 0.0, density * length),
            *(
                Parameter(n, "m", 0.0, 5.0 * length, -1e4 * length, 1e4 * length, shape=True)
                for n in ("north", "east", "down")
            ),
            *(Parameter(n, "m", 0.0, 0.3 * length, -length, length, shape=True) for n in "xyz"),
        )

    @classmethod
    def starts(cls, parameters: tuple[Parameter, ...], extent: Extent) -> list[dict[str, float]]:
        """Return no slack, and as much as is taut on half of the log and on its outskirts."""
        middle, far = extent.distance
        return [{"slack": 0.0}, {"slack": middle}, {"slack": 0.5 * (middle + far)}]

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the smallest distance of which the direction counts."""
        self.keep("tiny", TINY * float(vehicle.length) ** 2)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the cable's pull."""
        theta, tiny = self.theta.to(moment.nu), self.kept("tiny").to(moment.nu)
        stiffness, slack, weight, drag = theta[:4].unbind(-1)
        arm = theta[7:].expand_as(moment.position)
        away = moment.position + matvec(moment.rotation, arm) - theta[4:7]
        length = torch.sqrt((away * away).sum(-1, keepdim=True) + tiny)
        pull = -stiffness * torch.clamp(1 - slack / length, min=0.0) * away
        pull = pull + torch.nn.functional.pad(0.5 * weight * length, (2, 0))
        v = moment.drag_flow[..., :3] + cross(moment.drag_flow[..., 3:], arm)
        speed = torch.sqrt((v * v).sum(-1, keepdim=True) + 1e-30)
        force = matvec(moment.rotation.mT, pull) - drag * length * speed * v
        return torch.cat([force, cross(arm, force)], dim=-1)
