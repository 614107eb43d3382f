"""Vehicles that are steered by fins: what each fin does under way, and the trim that holds the depth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.models import GreyBox, Inputs
from auvnn.physics.attitude import euler_to_quat, quat_to_matrix
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]


def fin_slopes(vehicle: Vehicle) -> Array:
    """Return the wrench per radian of each fin at a forward speed of 1 m/s, N and N m, (6, m).

    1/2 rho A c_La [a x e_x; r x (a x e_x)]; it grows with the square of the speed.
    """
    axes, places = (np.array([getattr(f, n) for f in vehicle.fins]) for n in ("axis", "position"))
    push = np.cross(axes, [1.0, 0.0, 0.0])
    size = 0.5 * vehicle.water_density * np.array([f.area * f.lift_slope for f in vehicle.fins])
    return (size[:, None] * np.concatenate([push, np.cross(places, push)], axis=1)).T


def pattern(slopes: Array, axis: int) -> Array:
    """Return how the fins turn together for a moment about one axis, largest angle one, (m,)."""
    row = slopes[axis]
    return row / max(np.abs(row).max(), 1e-12)


@dataclass(frozen=True)
class Cruise:
    """Steady level travel.

    Attributes:
        nu: velocity, (6,).
        pitch: rad.
        fins: fin angles, rad, (m,).
    """

    nu: Array
    pitch: float
    fins: Array


def cruise(model: GreyBox, command: Array) -> Cruise:
    """Return the steady state in which the vehicle keeps its depth under constant thrust.

    Found by least squares on surge, heave and pitch acceleration and the climb rate, with fins within half
    their stall angle; where it cannot keep its depth this is the nearest it comes.

    Args:
        model: with fins.
        command: of the thrusters, (n,).
    """
    from scipy.optimize import least_squares

    vehicle = model.vehicle
    up = pattern(fin_slopes(vehicle), 4)
    most = 0.5 * min(f.stall for f in vehicle.fins)

    def residual(state: Array) -> Array:
        speed, heave, pitch, angle = state
        rotation = quat_to_matrix(euler_to_quat(torch.tensor([0.0, pitch, 0.0], dtype=torch.float64)))
        nu = torch.tensor([speed, 0.0, heave, 0.0, 0.0, 0.0], dtype=torch.float64)
        inputs = Inputs(torch.tensor(command), torch.tensor(angle * up))
        thrust = model.actuators.static(inputs.command)
        with torch.no_grad():
            rate = model.nu_dot(nu[:3] * 0, rotation, nu, thrust, inputs, nu[0] * 0).numpy()
        climb = heave * np.cos(pitch) - speed * np.sin(pitch)
        return np.array([rate[0], rate[2], rate[4], climb])

    bound = np.array([10.0, 1.0, 0.6, most])
    low = np.array([0.05, -1.0, -0.6, -most])
    found = least_squares(residual, [1.0, 0.0, 0.0, 0.0], bounds=(low, bound))
    speed, heave, pitch, angle = found.x
    return Cruise(np.array([speed, 0.0, heave, 0.0, 0.0, 0.0]), float(pitch), angle * up)
