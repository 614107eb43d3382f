"""Water inside the hull that has to move along."""

from __future__ import annotations

from typing import Any

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class TrappedWater(Effect):
    """Mass of enclosed water that weighs nothing in water: m <- m + mass at the centre of gravity.

    It adds inertia and Coriolis forces of a rigid body and no weight; from added mass, whose Coriolis forces
    know the relative velocity, only a current tells it. Reference: Fossen (2011), sections 3.3 and 6.3.
    """

    name = "trapped_water"
    cause = "water inside the hull moves along"
    symbol = "m_w"
    reference = "Fossen (2011), sections 3.3 and 6.3"
    confused_with = ("added_mass", "thruster_lag")
    manoeuvre = "chirp"
    told_apart_by = "swept sines, and a static weighing"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the mass; a tenth of the vehicle's is plausible."""
        mass = float(vehicle.mass)
        return (Parameter("mass", "kg", 0.0, 0.1 * mass, -0.5 * mass, 5 * mass),)

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Add to the mass and not to the weight."""
        return body.but(mass=body.mass + self.theta[0].to(body.mass), weight_centre=body.hangs)
