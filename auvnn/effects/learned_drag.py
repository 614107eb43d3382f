"""What learned damping may be wrong by."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import AXES, Body, Effect, Moment, Parameter
from auvnn.physics.products import matvec

SPEEDS = "uvwpqr"


class LearnedDrag(Effect):
    """A correction of drag, linear and quadratic in the velocities through the water, with every coupling.

    tau <- tau - A nu_r - B |nu_r| nu_r. It stands for what a diagnosis cannot know of damping that was learned: it is
    uncertain together with what else is, and as a cause of its own it names nothing, so the catalogue does not
    offer it. Reference: Fossen (2011), section 6.4.
    """

    name = "learned_drag"
    cause = "learned damping is off"
    symbol = "d"
    reference = "Fossen (2011), section 6.4"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return 36 linear coefficients, row by row, and 36 quadratic ones."""
        force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
        sizes = [force] * 3 + [0.1 * force * float(vehicle.length)] * 3
        out = []
        for kind, power in (("", 1), ("_abs", 2)):
            for axis, size in zip(AXES, sizes, strict=True):
                for speed in SPEEDS:
                    unit = f"{'N' if axis in 'XYZ' else 'N m'}/({'m' if speed in 'uvw' else 'rad'}/s)"
                    unit += "" if power == 1 else "2"
                    out.append(Parameter(f"{axis}_{speed}{kind}", unit, 0.0, size, -1e6, 1e6))
        return tuple(out)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the force and moment of the corrections."""
        linear, quadratic = self.theta.to(moment.nu_r).unflatten(-1, (2, 6, 6)).unbind(-3)
        return -matvec(linear, moment.nu_r) - matvec(quadratic, moment.nu_r.abs() * moment.nu_r)
