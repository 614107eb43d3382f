"""Orders of magnitude of a vehicle's forces, for the plausible scales of effects; no effect itself."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def volume(vehicle: Any) -> float:
    """Return the displaced volume, m3: B / (rho g)."""
    return float(vehicle.buoyancy) / (float(vehicle.water_density) * float(vehicle.gravity))


def radius(vehicle: Any) -> float:
    """Return the radius of the sphere of the same volume, m."""
    return float((3 * volume(vehicle) / (4 * np.pi)) ** (1 / 3))


def translational_drag(vehicle: Any) -> Array:
    """Return quadratic drag along x, y and z, N s2/m2, (3,); that of a bluff body where none is stated.

    A body of volume V has about 1/2 rho C_d V^(2/3) with C_d of one.
    """
    stated = np.zeros(3)
    if vehicle.quadratic_damping is not None:
        stated += np.diag(vehicle.quadratic_damping)[:3]
    for element in vehicle.damping_elements:
        # Along body axes, from the element's own: an order of magnitude is all that is asked for.
        stated += np.abs(element.axes) @ element.quadratic[:3]
    bluff = 0.5 * float(vehicle.water_density) * volume(vehicle) ** (2 / 3)
    return np.where(stated > 1e-3 * bluff, stated, bluff)


def full_wrench(vehicle: Any) -> Array:
    """Return an actuator's full effort by degree of freedom, N and N m, (6,).

    What the thrusters give together where there are any; else a tenth of the weight, at half the length.
    """
    if len(vehicle.thrusters):
        force = np.array([max(u.max_forward, u.max_reverse) for u in vehicle.thrusters])
        arm = np.array([[*u.direction, *np.cross(u.position, u.direction)] for u in vehicle.thrusters])
        sums = np.abs(arm.T) @ force
    else:
        sums = np.zeros(6)
    weight = 0.1 * float(vehicle.mass) * float(vehicle.gravity)
    usual = np.array([weight] * 3 + [0.5 * weight * float(vehicle.length)] * 3)
    return np.where(sums > 1e-3 * usual, sums, usual)


def usual_speeds(vehicle: Any) -> Array:
    """Return moderate speeds of a vehicle's size, m/s and rad/s, (6,): 0.16 sqrt(g L) and 0.128 sqrt(g / L).

    Half a metre and 0.4 radians per second for a vehicle of one metre.
    """
    length, gravity = float(vehicle.length), float(vehicle.gravity)
    return np.array([0.16 * np.sqrt(gravity * length)] * 3 + [0.128 * np.sqrt(gravity / length)] * 3)
