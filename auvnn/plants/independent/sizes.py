"""What of a vehicle's size the public definitions of effects refer to, worked out from its file."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]


def sphere_radius(vehicle: Vehicle) -> float:
    """Return the radius of the sphere that displaces as much water, m."""
    displaced = vehicle.buoyancy / (vehicle.water_density * vehicle.gravity)
    return float(np.cbrt(0.75 * displaced / np.pi))


def own_drag(vehicle: Vehicle) -> Array:
    """Return the vehicle's stated quadratic drag along x, y and z, N s2/m2, (3,).

    Elements count by the size of their axes' components. Where (next to) nothing is stated: a bluff body with
    a drag coefficient of one on the area V^(2/3).
    """
    drag = np.zeros(3)
    if vehicle.quadratic_damping is not None:
        drag += vehicle.quadratic_damping.diagonal()[:3]
    for part in vehicle.damping_elements:
        for axis, q in zip(part.axes.T, part.quadratic[:3], strict=True):
            drag += np.abs(axis) * q
    area = (vehicle.buoyancy / (vehicle.water_density * vehicle.gravity)) ** (2.0 / 3.0)
    bluff = 0.5 * vehicle.water_density * area
    return np.where(drag > 1e-3 * bluff, drag, bluff)


def full_effort(vehicle: Vehicle) -> Array:
    """Return what counts as full command where a wrench is commanded, N and N m, (6,).

    The sum of all thrusters' shares; where that is (next to) nothing a tenth of the weight, at half the length.
    """
    effort = np.zeros(6)
    for unit in vehicle.thrusters:
        most = max(unit.max_forward, unit.max_reverse)
        effort += most * np.abs([*unit.direction, *np.cross(unit.position, unit.direction)])
    force = 0.1 * vehicle.weight
    usual = np.repeat([force, 0.5 * force * vehicle.length], 3)
    return np.where(effort > 1e-3 * usual, effort, usual)


def usual_speeds(vehicle: Vehicle) -> Array:
    """Return the speeds at which drag of another exponent equals the stated one, m/s and rad/s, (6,).

    Froude numbers of 0.16 along and, as the turn rate times the length, 0.128 around.
    """
    wave = np.sqrt(vehicle.gravity * vehicle.length)
    return np.repeat([0.16 * wave, 0.128 * wave / vehicle.length], 3)
