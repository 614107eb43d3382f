"""The cylinder that the payload case picks up: what it adds to a vehicle's matrices, and what the grasp does."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.physics.inertia import rigid_body_inertia, screw
from auvnn.vehicle import Vehicle
from auvnn.vehicle.parts import DampingElement

Array = NDArray[np.float64]
# Drag coefficients of a circular cylinder, across and along its axis (Hoerner 1965, chapters 3-9 and 3-12).
CROSS, ALONG = 0.8, 0.9
# Added mass along the axis as a share of the mass, of a cylinder about five diameters long (Newman 1977, table 4.1).
AXIAL_ADDED = 0.05


@dataclass(frozen=True)
class Cylinder:
    """A uniform cylinder, rigidly held.

    Attributes:
        mass: kg.
        diameter: m.
        length: m.
        position: of its centre from the body origin, m, (3,).
        axes: columns are its axes in the body frame, the first along it, (3, 3).
        net_weight: weight less buoyancy, N.
    """

    mass: float
    diameter: float
    length: float
    position: Array
    axes: Array
    net_weight: float

    @classmethod
    def build(cls, mass: float, described: Mapping[str, Any], density: float, gravity: float) -> Cylinder:
        """Return the cylinder of a mass that displaces what its net weight says.

        Args:
            mass: kg.
            described: `diameter` (m), `net_weight` (N), `axis` and `position` (m).
            density: of the water, kg/m3.
            gravity: m/s2.

        Raises:
            ConfigError: it is not a body.
        """
        diameter, net = float(described["diameter"]), float(described["net_weight"])
        displaced = mass - net / gravity
        if not (mass > 0.0 and 0.01 <= diameter <= 5.0 and displaced > 0.0):
            raise ConfigError(
                f"case.mass={mass:g} kg, case.cylinder.diameter={diameter:g} m, net_weight={net:g} N: not a body "
                "that displaces water; give a positive mass, and a net weight below mass times gravity"
            )
        axis, position = (np.asarray(described[k], dtype=np.float64) for k in ("axis", "position"))
        size = float(np.linalg.norm(axis)) if axis.shape == (3,) else 0.0
        if position.shape != (3,) or not size > 0.0 or not np.isfinite(position).all():
            raise ConfigError(
                "case.cylinder.position and axis take three numbers each, and the axis is not zero"
            )
        first = axis / size
        other = np.eye(3)[int(np.argmin(np.abs(first)))]
        second = np.cross(first, other)
        second /= np.linalg.norm(second)
        axes = np.asarray(np.stack([first, second, np.cross(first, second)], axis=1), dtype=np.float64)
        length = displaced / (density * math.pi * diameter**2 / 4.0)
        return cls(mass, diameter, length, position, axes, net)

    @property
    def inertia(self) -> Array:
        """About its centre, in the body's axes, kg m2, (3, 3)."""
        radius = 0.5 * self.diameter
        along = 0.5 * self.mass * radius**2
        across = self.mass * (3.0 * radius**2 + self.length**2) / 12.0
        return self.axes @ np.diag([along, across, across]) @ self.axes.T

    def added_mass(self, density: float) -> Array:
        """About the body origin, (6, 6): the displaced mass across it (strip theory), little along it."""
        cross = density * math.pi * self.diameter**2 / 4.0 * self.length
        turning = cross * self.length**2 / 12.0
        own = np.diag([AXIAL_ADDED * self.mass, cross, cross, 0.0, turning, turning])
        return _at(self.position, _turned(self.axes, own))

    def rigid(self) -> Array:
        """Rigid-body inertia about the body origin, (6, 6)."""
        made = rigid_body_inertia(
            torch.tensor(self.mass, dtype=torch.float64),
            torch.tensor(self.inertia),
            torch.tensor(self.position),
        )
        return made.numpy()

    def drag(self, density: float) -> DampingElement:
        """Quadratic drag of the cylinder about its own centre: across, along and end over end."""
        across = 0.5 * density * CROSS * self.diameter * self.length
        along = 0.5 * density * ALONG * math.pi * self.diameter**2 / 4.0
        # Strips along the length: 0.5 rho Cd d integral of |x|^3 = 0.5 rho Cd d (L/2)^4 / 2.
        turning = 0.5 * density * CROSS * self.diameter * (0.5 * self.length) ** 4 / 2.0
        quadratic = np.array([along, across, across, 0.0, turning, turning])
        return DampingElement(self.position, self.axes, np.zeros(6), quadratic)


def with_cylinder(vehicle: Vehicle, cylinder: Cylinder) -> Vehicle:
    """Return the vehicle with the cylinder held: mass, inertia, added mass, weight and buoyancy, not its drag."""
    m1, m2 = float(vehicle.mass), cylinder.mass
    mass = m1 + m2
    cg = (m1 * vehicle.center_of_gravity + m2 * cylinder.position) / mass
    inertia = vehicle.inertia + cylinder.inertia
    for part, at in ((m1, vehicle.center_of_gravity), (m2, cylinder.position)):
        arm = at - cg
        inertia = inertia + part * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    gravity = float(vehicle.gravity)
    lift = m2 * gravity - cylinder.net_weight
    buoyancy = float(vehicle.buoyancy) + lift
    cb = (float(vehicle.buoyancy) * vehicle.center_of_buoyancy + lift * cylinder.position) / buoyancy
    return replace(
        vehicle,
        name=f"{vehicle.name}-loaded",
        mass=mass,
        buoyancy=buoyancy,
        center_of_gravity=cg,
        center_of_buoyancy=cb,
        inertia=inertia,
        added_mass=vehicle.added_mass + cylinder.added_mass(float(vehicle.water_density)),
    )


def factored(
    vehicle: Vehicle, low: float, high: float, generator: np.random.Generator
) -> tuple[Vehicle, list[float]]:
    """Return the vehicle with every damping coefficient multiplied by a separate factor, and the factors.

    The factors are drawn evenly on a log scale; the smallest and the largest are then stretched to the range's ends,
    so that it is the stated range. Rows and columns of a full matrix are scaled by the roots of their factors, which
    keeps it positive definite.

    Args:
        vehicle: plain numbers.
        low: least factor.
        high: largest factor.
        generator: draws them.

    Raises:
        ConfigError: the range is not one.
    """
    if not 0.0 < low <= high <= 1000.0:
        raise ConfigError(f"case.factors: low={low:g} and high={high:g} are no range of positive factors")
    elements = list(vehicle.damping_elements)
    matrices = [
        name for name in ("linear_damping", "quadratic_damping") if getattr(vehicle, name) is not None
    ]
    drawn = generator.uniform(size=12 * len(elements) + 6 * len(matrices))
    if len(drawn) > 1:
        drawn = (drawn - drawn.min()) / np.ptp(drawn)
    factors = low * (high / low) ** drawn
    rest = iter(factors.reshape(-1, 6))
    changes: dict[str, Any] = {}
    for name in matrices:
        root = np.sqrt(next(rest))
        changes[name] = getattr(vehicle, name) * np.outer(root, root)
    parts = [replace(e, linear=e.linear * next(rest), quadratic=e.quadratic * next(rest)) for e in elements]
    return replace(vehicle, damping_elements=tuple(parts), **changes), factors.tolist()


def grasp(empty: GreyBox, cylinder: Cylinder) -> Array:
    """Return the matrix (6, 6) that turns the velocity before a rigid grasp of a body at rest into that after it.

    nu+ = (M + M_p)^-1 M nu-, M and M_p with their added masses: the momentum of vehicle, body and water is kept.
    """
    inertia = empty.prepare().total.detach().numpy()
    own = cylinder.rigid() + cylinder.added_mass(float(empty.vehicle.water_density))
    return np.asarray(np.linalg.solve(inertia + own, inertia), dtype=np.float64)


def _turned(axes: Array, matrix: Array) -> Array:
    both = np.kron(np.eye(2), axes)
    return both @ matrix @ both.T


def _at(position: Array, matrix: Array) -> Array:
    h = screw(torch.tensor(position)).numpy()
    return h.T @ matrix @ h
