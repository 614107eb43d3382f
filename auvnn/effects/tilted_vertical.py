"""An attitude whose vertical is not the true one."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Parameter, Sensed
from auvnn.physics.attitude import quat_multiply, rotvec_to_quat


class TiltedVertical(Effect):
    """The frame to which the attitude refers is turned by a small angle about north and east: q <- dq q.

    A tracker's frame, or a reference that was levelled badly: unlike a sensor that sits askew in the vehicle, the
    error in roll and pitch changes with the heading. Position and velocity are left alone.
    Reference: Fossen (2011), section 2.2 for the composition of rotations.
    """

    name = "tilted_vertical"
    cause = "the attitude's vertical is tilted"
    symbol = "delta_v"
    reference = "Fossen (2011), section 2.2"
    confused_with = ("cg_offset", "velocity_misalignment", "constant_force")
    manoeuvre = "reciprocal"
    told_apart_by = "level legs on several headings"
    plainer = ("cg_offset",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the rotation about the north and the east axis; a degree or two is plausible."""
        return tuple(Parameter(n, "rad", 0.0, 0.03, -0.5, 0.5) for n in ("north", "east"))

    def sense(self, sensed: Sensed) -> Sensed:
        """Turn the reported attitude, seen from the world."""
        turn = self.theta.to(sensed.quaternion)
        turn = turn.new_zeros(3).index_copy(0, turn.new_tensor([0, 1]).long(), turn)
        tilt: Tensor = rotvec_to_quat(turn)
        return replace(sensed, quaternion=quat_multiply(tilt.expand_as(sensed.quaternion), sensed.quaternion))
