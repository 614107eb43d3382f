"""Forces on the hull that do not come from its actuators: drag, walls and weight."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.plants.independent.around import Around
from auvnn.plants.independent.vectors import cross, dot
from auvnn.plants.laws import Laws
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]
Values = Mapping[str, float]


class Forces:
    """Forces of drag, walls and weight on R vehicles; `Equations` says the rest.

    Attributes:
        laws: where the world departs from these equations.
        curve: the drag's exponents and usual speeds.
        vehicle: plain numbers.
        effects: all that act, name to parameters, in order.
        hull: masses, added mass and drag.
        growing: parts whose mass grows.
        held: share of a load that is carried, over time, or None.
        radius: of the sphere of the vehicle's volume, m.
        bottom: depth, m, or None.
        drags: whether linear and quadratic drag are there.
    """

    laws: Laws
    curve: Laws
    vehicle: Vehicle
    effects: Mapping[str, Values]
    hull: Any
    growing: list[Any]
    held: Any
    radius: float
    bottom: float | None
    drags: list[bool]

    def drag(self, flow: Array, turn: Array) -> Array:
        """Return the stated drag with what effects made of it, (R, 6)."""
        hull = self.hull
        nu = np.concatenate([flow, turn], axis=-1)
        out = np.zeros_like(nu)
        if self.drags[0]:
            out -= nu @ hull.linear.T
        if self.drags[1]:
            out -= self.curve.powers(nu) @ hull.quadratic.T
        for place, axes, linear, quadratic in hull.parts:
            arm = np.broadcast_to(place, flow.shape)
            own = np.concatenate([(flow + cross(turn, arm)) @ axes, turn @ axes], axis=-1)
            law = -linear * own - quadratic * self.curve.powers(own)
            force, moment = law[:, :3] @ axes.T, law[:, 3:] @ axes.T
            out += np.concatenate([force, moment + cross(arm, force)], axis=-1)
        return out

    def _wall(self, name: str, depth: Array) -> tuple[Array, Array]:
        """Return f and its slope with depth, (R, 1), of a boundary's share in the added mass."""
        values = self.effects[name]
        above = name == "surface_proximity"
        if not above and self.bottom is None:
            return 0.0 * depth, 0.0 * depth
        away = depth if above else (self.bottom or 0.0) - depth
        h = np.maximum(away, self.radius)
        f = (-1.0 if above else 1.0) * values["strength"] * (self.radius / h) ** values["exponent"]
        slope = np.where(away > self.radius, -values["exponent"] * f / h, 0.0)
        return f, slope if above else -slope

    def _more_drag(self, t: float, near: Around) -> Array | None:
        """Return by what share the drag has grown, (R, 1) or (6,)."""
        more = None
        if "biofouling" in self.effects:
            more = np.full(6, self.effects["biofouling"]["rate"] * t)
        if self.held is not None:
            load = self.effects["payload"]
            part = self.held(t)[0] * (np.array([load[a] for a in "XYZKMN"]) - 1.0)
            more = part if more is None else more + part
        for f, _ in near.walls:
            more = f if more is None else more + f
        return more

    def _walls(self, v: Array, turn: Array, down: Array, near: Around) -> Array:
        """Return -(dM_A/dz) nu_r z_dot and the pull of the energy's gradient, (R, 6)."""
        still = np.concatenate([near.flow, turn], axis=-1) @ self.hull.added.T
        energy = 0.5 * (dot(near.flow, still[:, :3]) + dot(turn, still[:, 3:]))
        slope = np.zeros_like(energy)
        for i, (_, own) in enumerate(near.walls):
            for j, (f, _) in enumerate(near.walls):
                own = own if i == j else own * (1.0 + f)
            slope = slope + own
        out = -slope * dot(down, v) * still
        out[:, :3] += slope * energy * down
        return out

    def _weight(self, t: float, down: Array, flow: Array, turn: Array) -> Array:
        """Return weight and buoyancy, of hull and load, and what it takes to carry new mass along, (R, 6)."""
        hull = self.hull
        force = (hull.weight - hull.buoyancy) * down
        hanging = hull.weight * hull.cg - hull.buoyancy * hull.cb
        turning = np.zeros_like(down)
        for lump in self.growing:
            assert lump.share is not None
            share, rate = lump.share(t)
            pull = share * (lump.mass * self.vehicle.gravity - lump.lift)
            hanging = hanging + pull * lump.place
            arm = np.broadcast_to(lump.place, flow.shape)
            jerk = -rate * lump.mass * (flow + cross(turn, arm))
            force = force + pull * down + jerk
            turning = turning + cross(arm, jerk)
        turning = turning + cross(np.broadcast_to(hanging, down.shape), down)
        return np.concatenate([force, turning], axis=-1)
