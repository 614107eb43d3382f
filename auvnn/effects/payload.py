"""A load that is picked up, or let go, at some time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import AXES, Effect
from auvnn.effects.hooks import Body, Extent, Moment, Parameter
from auvnn.physics.restoring import restoring_force

GRASP = 0.3
"""Duration of the grasp, in units of sqrt(length / gravity): about a tenth of a second for 1 m."""
PLACES = ("x", "y", "z")
TIMES = 8
"""At so many times it is asked for, and between any two of them that are further apart than a fit finds its way."""
LATEST = 1e10
"""s: later than the stamps of any log, dates among them."""
SURE = 1.0
"""s: an onset that is off by less is found by the fit, and one that is nearer to an end of the log is not seen."""


class Payload(Effect):
    """From `time` on the vehicle carries a point mass at r with its own buoyancy, and drags more.

    s(t) = 1 / (1 + exp(-(t - time) / (0.3 sqrt(L/g)))) switches on: mass s m_p with weight s m_p g and buoyancy
    s B_p, both at r; the inertia follows by the parallel axes. The load was at rest in the water, so the grasp
    conserves momentum: force -s' m_p (v_r + omega x r) at r. The drag in each degree of freedom is multiplied
    by 1 + s (factor - 1). Negative mass and buoyancy stand for ballast that is dropped.
    Reference: Van de Ven et al. (2004), section 5; Fossen (2011), section 3.3.
    """

    name = "payload"
    cause = "a load is picked up at some time"
    symbol = "m_p"
    reference = "Van de Ven et al. (2004), section 5; Fossen (2011), section 3.3"
    # Water that is trapped is a load whose buoyancy bears its weight, at the centre of gravity.
    confused_with = ("net_buoyancy", "cg_offset", "flooding", "trapped_water")
    manoeuvre = "multisine"
    told_apart_by = "the same motion before and after the load is taken, turning included"
    levers = PLACES
    carried = ("mass", "buoyancy")
    plainer = ("net_buoyancy", "trapped_water", "cg_offset")
    time_varying = True

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return time, mass, place, buoyancy and the factors on the drag."""
        mass, length = float(vehicle.mass), float(vehicle.length)
        weight = mass * float(vehicle.gravity)
        return (
            Parameter("time", "s", 0.0, 10.0, 0.0, LATEST, probes=(0.5,), shape=True),
            Parameter("mass", "kg", 0.0, 0.05 * mass, -0.5 * mass, 5 * mass),
            *(Parameter(n, "m", 0.0, 0.3 * length, -3 * length, 3 * length, shape=True) for n in PLACES),
            Parameter("buoyancy", "N", 0.0, 0.05 * weight, -0.5 * weight, 5 * weight),
            *(Parameter(axis, "1", 1.0, 0.3, 0.01, 20.0) for axis in AXES),
        )

    @classmethod
    def starts(cls, parameters: tuple[Parameter, ...], extent: Extent) -> list[dict[str, float]]:
        """Return eight times, evenly over what was recorded."""
        return [{"time": extent.moment((k + 0.5) / TIMES)} for k in range(TIMES)]

    @classmethod
    def closest(
        cls, parameters: tuple[Parameter, ...], extent: Extent, shape: dict[str, float], level: int
    ) -> list[dict[str, float]]:
        """Return times before and after the one found, at the place found, until they are a second apart."""
        before = extent.seconds() / TIMES ** (level + 1)
        if before <= SURE:
            return []
        times = [shape["time"] + k / TIMES * before for k in range(1 - TIMES, TIMES)]
        return [
            {**shape, "time": t} for t in times if any(low <= t <= high for low, high in extent.recorded())
        ]

    @classmethod
    def happens(cls, values: Mapping[str, float], extent: Extent) -> bool:
        """Whether the load is taken within what was recorded: one that is there all along is weight, water and drag."""
        return any(low + SURE < values["time"] < high - SURE for low, high in extent.recorded())

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep gravity and the duration of the grasp."""
        self.keep("gravity", vehicle.gravity)
        self.keep("grasp", GRASP * (float(vehicle.length) / float(vehicle.gravity)) ** 0.5)

    def _held(self, moment: Moment) -> tuple[Tensor, Tensor]:
        """Return s and its rate, 1/s."""
        grasp = self.kept("grasp").to(moment.nu)
        share = torch.sigmoid((moment.time.to(moment.nu) - self.value("time").to(moment.nu)) / grasp)
        return share, share * (1 - share) / grasp

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Add mass, weight and inertia; the rest is in `wrench`."""
        assert moment is not None
        load = self.value("mass").to(moment.nu) * self._held(moment)[0]
        mass = body.mass + load
        part = (load / mass).unsqueeze(-1)
        arm = self.theta[2:5].to(moment.nu) - body.cg
        eye = torch.eye(3, dtype=arm.dtype, device=arm.device)
        square = (arm * arm).sum(-1)[..., None, None] * eye - arm.unsqueeze(-1) * arm.unsqueeze(-2)
        inertia = body.inertia + (body.mass.unsqueeze(-1) * part).unsqueeze(-1) * square
        moved = body.but(mass=mass, cg=body.cg + part * arm, inertia=inertia, weight_centre=body.hangs)
        # Enclosed water has mass and no weight, so the two centres need not be one.
        return moved.hung(self.kept("gravity").to(load) * load, self.theta[2:5].to(moment.nu))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the load's buoyancy, the jerk of the grasp, and the added drag."""
        assert moment.drag is not None
        share, rate = self._held(moment)
        mass, place = self.value("mass").to(share), self.theta[2:5].to(share)
        lift = (share * self.value("buoyancy").to(share)).expand(moment.nu.shape[:-1])
        up = -restoring_force(moment.rotation, torch.zeros_like(lift), lift, place, place)
        v, omega = moment.nu_r[..., :3], moment.nu_r[..., 3:]
        place = place.expand_as(v)
        force = -(rate * mass).unsqueeze(-1) * (v + torch.linalg.cross(omega, place))
        jerk = torch.cat([force, torch.linalg.cross(place, force)], dim=-1)
        drag = share.unsqueeze(-1) * (self.theta[6:].to(share) - 1) * moment.drag
        return up + jerk + drag
