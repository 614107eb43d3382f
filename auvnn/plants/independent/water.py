"""The water's motion over ground, and the waves' pressure."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]
Values = Mapping[str, float]


def current(values: Values, vehicle: Vehicle, t: float, place: Array, moving: Array) -> tuple[Array, Array]:
    """A steady current, the same everywhere.

    Args:
        values: of the effect: `v_north`, `v_east` and `v_down`, m/s.
        vehicle: not used.
        t: not used.
        place: NED, m, (R, 3).
        moving: not used.
    """
    steady = np.array([values["v_north"], values["v_east"], values["v_down"]])
    return np.broadcast_to(steady, place.shape), np.zeros_like(place)


def shear(values: Values, vehicle: Vehicle, t: float, place: Array, moving: Array) -> tuple[Array, Array]:
    """A horizontal current in proportion to depth, as one meets it who sinks.

    Args:
        values: of the effect: `north` and `east`, 1/s.
        vehicle: not used.
        t: not used.
        place: NED, m, (R, 3).
        moving: velocity over ground, NED, m/s, (R, 3).
    """
    gradient = np.array([values["north"], values["east"], 0.0])
    return place[:, 2:] * gradient, moving[:, 2:] * gradient


def waves(values: Values, vehicle: Vehicle, t: float, place: Array, moving: Array) -> tuple[Array, Array]:
    """A regular deep-water wave, from the complex potential: velocity and local acceleration.

    Horizontal velocity is the real part of W, downward velocity minus its imaginary part, where
    W = a omega exp(-k z) exp(i (k xi - omega t + phase)); the acceleration follows by the factor -i omega.

    Args:
        values: of the effect: `amplitude` (m), `omega` (rad/s), `direction` and `phase` (rad).
        vehicle: for its gravity.
        t: s.
        place: NED, m, (R, 3).
        moving: velocity over ground, NED, m/s, (R, 3).
    """
    omega = values["omega"]
    k = omega**2 / vehicle.gravity
    ahead = np.array([np.cos(values["direction"]), np.sin(values["direction"])])
    phase = k * (place[:, :2] @ ahead) - omega * t + values["phase"]
    size = values["amplitude"] * omega * np.exp(-k * np.maximum(place[:, 2], 0.0))
    w = size * np.cos(phase), size * np.sin(phase)
    # -i omega W
    w_dot = omega * w[1], -omega * w[0]

    def vector(real: Array, imaginary: Array) -> Array:
        return np.stack([real * ahead[0], real * ahead[1], -imaginary], axis=-1)

    return vector(*w), vector(*w_dot)


Field = Callable[[Values, Vehicle, float, Array, Array], tuple[Array, Array]]

WATERS: dict[str, Field] = {"ocean_current": current, "current_shear": shear, "waves": waves}
"""Effects that move the water: velocity and acceleration, NED, (R, 3) each, at places (R, 3) moving (R, 3)."""


def water(
    effects: Mapping[str, Values], vehicle: Vehicle, t: float, place: Array, moving: Array
) -> tuple[Array, Array]:
    """Return the water's velocity and acceleration at the vehicles, NED, m/s and m/s2, (R, 3).

    Args:
        effects: that act, name to parameters.
        vehicle: plain numbers.
        t: s.
        place: NED, m, (R, 3).
        moving: velocity over ground, NED, m/s, (R, 3).
    """
    velocity, acceleration = np.zeros_like(place), np.zeros_like(place)
    for name, values in effects.items():
        if name in WATERS:
            v, a = WATERS[name](values, vehicle, t, place, moving)
            velocity, acceleration = velocity + v, acceleration + a
    return velocity, acceleration
