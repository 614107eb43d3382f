"""Control fins: lift across the local flow, from the angle between chord and flow."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auvnn.plants.independent.vectors import cross
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]


class Fins:
    """All fins of a vehicle.

    The chord turns with the fin's angle; the angle of attack is that from the flow in the fin's plane to the
    chord, taken within a right angle because the profile is the same fore and aft. The lift coefficient blends
    from c_La alpha, and c_c alpha^2 of the flow around the tips, into a flat plate's 2 sin|sin| cos about the
    stall angle, over a twelfth of it, by a logistic function that is one at no angle of attack.

    Args:
        vehicle: whose fins.
        separation: share of the lift that is c_La a cos(a) / sqrt(1 + (a / a_0)^4) instead: it stalls gently.
        effects: on the fins: their gain, offset, drag and stall.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        separation: float = 0.0,
        effects: Mapping[str, Mapping[str, float]] | None = None,
    ) -> None:
        """Collect geometry."""
        given = effects or {}
        names = [f"fin_{i + 1}" for i in range(len(vehicle.fins))]
        self.gain = np.array([given.get("fin_gain", {}).get(n, 1.0) for n in names])
        self.offset = np.array([given.get("fin_offset", {}).get(n, 0.0) for n in names])
        drag = given.get("fin_drag", {})
        self.zero_lift, self.induced = drag.get("zero_lift", 0.0), drag.get("induced", 0.0)
        stall = given.get("fin_stall", {})
        self.width = 12.0 * stall.get("sharpness", 1.0)
        self.tips = stall.get("crossflow", 0.0)
        self.plate = 2.0 * stall.get("separated", 1.0)
        self.separation = separation
        fins = vehicle.fins
        self.place, self.axis = np.array([f.position for f in fins]), np.array([f.axis for f in fins])
        self.size = 0.5 * vehicle.water_density * np.array([f.area for f in fins])
        self.slope, self.stall = (
            np.array([f.lift_slope for f in fins]),
            stall.get("factor", 1.0) * np.array([f.stall for f in fins]),
        )
        ahead = np.array([1.0, 0.0, 0.0]) - self.axis[:, :1] * self.axis
        self.ahead = ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
        self.across = np.cross(self.axis, self.ahead)

    def wrench(self, flow: Array, turn: Array, angles: Array | None) -> tuple[Array, Array]:
        """Return force and moment (R, 3) each.

        Args:
            flow: velocity through the water, (R, 3).
            turn: angular rate, (R, 3).
            angles: rad, (R, m), or None for zero.
        """
        angle = self.offset + (np.zeros((len(flow), len(self.size))) if angles is None else angles)
        chord = np.cos(angle)[..., None] * self.ahead + np.sin(angle)[..., None] * self.across
        local = flow[:, None] + cross(
            np.broadcast_to(turn[:, None], chord.shape), self.place[None] + 0 * chord
        )
        local = local - (local * self.axis).sum(-1, keepdims=True) * self.axis
        axis = np.broadcast_to(self.axis, chord.shape)
        side, along = (axis * cross(local, chord)).sum(-1), (local * chord).sum(-1)
        # A chord that points backwards is the same profile the other way round.
        attack = np.arctan2(np.where(along < 0, -side, side), np.abs(along))
        past = np.minimum(self.width * (np.abs(attack) / self.stall - 1.0), 700.0)
        blend = (1.0 + np.exp(-self.width)) / (1.0 + np.exp(past))
        sine = np.sin(attack)
        plate = self.plate * np.sign(sine) * sine**2 * np.cos(attack)
        lift = blend * self.slope * attack + (1.0 - blend) * plate
        lift = lift + blend * self.tips * np.sign(attack) * attack**2
        if self.separation:
            gentle = self.slope * attack * np.cos(attack) / np.sqrt(1.0 + (attack / self.stall) ** 4)
            lift = lift + self.separation * (gentle - lift)
        speed = np.sqrt((local * local).sum(-1))
        force = (self.gain * self.size * lift * speed)[..., None] * cross(axis, local)
        if self.zero_lift or self.induced:
            # Against the flow, with the lift coefficient as stated: a wake takes from the lift, not from the drag.
            force = force - (self.size * (self.zero_lift + self.induced * lift**2) * speed)[..., None] * local
        return force.sum(1), cross(self.place[None] + 0 * force, force).sum(1)
