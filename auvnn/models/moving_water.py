"""The water that moves, as the parts of the equations of motion feel it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from auvnn.effects import Effect, Moment
from auvnn.physics.current import water_velocity


def in_moving_water(moment: Moment, moving: Sequence[Effect], flows: Sequence[Effect]) -> Moment:
    """Return the moment with the velocity through the water, and the water's acceleration.

    Args:
        moment: as if the water were still.
        moving: effects that move the water, at least one; their motions add up.
        flows: effects that say how much of that motion everything except the drag feels.
    """
    velocity, acceleration = moving[0].water(moment)
    for effect in moving[1:]:
        more, faster = effect.water(moment)
        velocity, acceleration = velocity + more, acceleration + faster
    nu_c, nu_c_dot = water_velocity(moment.rotation, moment.nu[..., 3:], velocity, acceleration)
    moment = replace(moment, nu_r=moment.nu - nu_c, nu_c_dot=nu_c_dot)
    for effect in flows:
        moment = effect.flow(moment)
    return moment
