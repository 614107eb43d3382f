"""The vehicle as lumps of mass, a fluid that moves along, and drag: what the effects make of it before it moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.plants.independent.sizes import usual_speeds
from auvnn.plants.independent.vectors import cross_matrix
from auvnn.plants.laws import Laws
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]
Values = Mapping[str, float]


@dataclass
class Lump:
    """A rigid part of the vehicle: mass that is there from the beginning, or comes in as time goes by.

    Attributes:
        mass: kg, once it is all there (or per second, for a leak).
        place: centre of mass, m, (3,).
        inertia: about it, kg m2, (3, 3).
        lift: its own buoyancy, N, once it is all there.
        share: time, s, to what share of the mass is there and its rate, 1/s; None for all of it, always.
    """

    mass: float
    place: Array
    inertia: Array = field(default_factory=lambda: np.zeros((3, 3)))
    lift: float = 0.0
    share: Callable[[float], tuple[float, float]] | None = None

    def moments(self) -> tuple[float, Array, Array]:
        """Return mass, first moment m r and inertia about the origin, all of it there."""
        x = cross_matrix(self.place)
        return self.mass, self.mass * self.place, self.inertia - self.mass * x @ x


@dataclass
class Hull:
    """The vehicle with its effects on mass, fluid and drag.

    Attributes:
        lumps: rigid parts, the hull first.
        weight: N, of the hull alone, at its centre of gravity.
        buoyancy: N, of the hull alone, at `cb`.
        cb: centre of buoyancy, m.
        added: added mass (6, 6).
        linear: D_L (6, 6).
        quadratic: D_Q (6, 6), acts on |nu| nu.
        parts: displaced drag: position, axes, linear and quadratic coefficients along the axes.
    """

    lumps: list[Lump]
    weight: float
    buoyancy: float
    cb: Array
    added: Array
    linear: Array
    quadratic: Array
    parts: list[tuple[Array, Array, Array, Array]]

    @property
    def cg(self) -> Array:
        """The hull's own centre of gravity, m."""
        return self.lumps[0].place


AXES = ("X", "Y", "Z", "K", "M", "N")
SPEEDS = ("u", "v", "w", "p", "q", "r")


def _each(values: Values, names: Sequence[str]) -> Array:
    return np.array([values[n] for n in names])


def _both_sides(matrix: Array, factors: Array) -> Array:
    """Multiply entry (i, j) by the geometric mean of the factors i and j."""
    return matrix * np.sqrt(np.outer(factors, factors))


def _added_mass(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    hull.added = _both_sides(hull.added, _each(values, AXES))


def _linear(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    factors = _each(values, AXES)
    hull.linear = _both_sides(hull.linear, factors)
    hull.parts = [(r, a, d * factors, q) for r, a, d, q in hull.parts]


def _quadratic(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    factors = _each(values, AXES)
    hull.quadratic = _both_sides(hull.quadratic, factors)
    hull.parts = [(r, a, d, q * factors) for r, a, d, q in hull.parts]


def _coupled(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    # `Nv` is SNAME's N_v|v|: a moment N = Nv v |v|, while D_Q stands on the other side of the equation.
    hull.quadratic = hull.quadratic.copy()
    for name, value in values.items():
        hull.quadratic[AXES.index(name[0]), SPEEDS.index(name[1])] -= value


def _unstated(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    # Names such as "linear_Y": what resists a unit of velocity, or of its square, in that degree of freedom.
    hull.linear, hull.quadratic = hull.linear.copy(), hull.quadratic.copy()
    for name, value in values.items():
        kind, axis = name.split("_")
        matrix = hull.linear if kind == "linear" else hull.quadratic
        matrix[AXES.index(axis), AXES.index(axis)] += value


def _inertia(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    hull.lumps[0].inertia = _both_sides(hull.lumps[0].inertia, _each(values, AXES[3:]))


def _cg(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    hull.lumps[0].place = hull.lumps[0].place + _each(values, "xyz")


def _net_buoyancy(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    hull.buoyancy += values["force"]


def _trapped(hull: Hull, values: Values, vehicle: Vehicle) -> None:
    hull.lumps[0].mass += values["mass"]


CHANGES: dict[str, Callable[[Hull, Values, Vehicle], None]] = {
    "added_mass": _added_mass,
    "linear_damping": _linear,
    "quadratic_damping": _quadratic,
    "inertia": _inertia,
    "coupled_damping": _coupled,
    "unstated_damping": _unstated,
    "cg_offset": _cg,
    "net_buoyancy": _net_buoyancy,
    "trapped_water": _trapped,
}
"""Effects that change what the vehicle is, once and for all: factors on what it has, before anything is added to it."""


def build(vehicle: Vehicle, effects: Mapping[str, Values]) -> Hull:
    """Return the vehicle with the effects that change it for good; a load and a leak come as further lumps."""
    zero = np.zeros((6, 6))
    hull = Hull(
        [Lump(vehicle.mass, np.array(vehicle.center_of_gravity), np.array(vehicle.inertia))],
        vehicle.mass * vehicle.gravity,
        vehicle.buoyancy,
        np.array(vehicle.center_of_buoyancy),
        np.array(vehicle.added_mass),
        zero if vehicle.linear_damping is None else np.array(vehicle.linear_damping),
        zero if vehicle.quadratic_damping is None else np.array(vehicle.quadratic_damping),
        [(e.position, e.axes, np.array(e.linear), np.array(e.quadratic)) for e in vehicle.damping_elements],
    )
    for name, change in CHANGES.items():
        if name in effects:
            change(hull, effects[name], vehicle)
    if "payload" in effects:
        hull.lumps.append(_load(effects["payload"], vehicle))
    if "flooding" in effects:
        hull.lumps.append(Lump(effects["flooding"]["rate"], hull.cg, share=lambda t: (t, 1.0)))
    return hull


def curved(laws: Laws, vehicle: Vehicle, effects: Mapping[str, Values]) -> Laws:
    """Return the laws with the exponents that an effect gives the drag, beside those of the world.

    Args:
        laws: of the world.
        vehicle: for its usual speeds.
        effects: that act, name to parameters.
    """
    if "drag_curve" not in effects:
        return laws
    own = _each(effects["drag_curve"], AXES)
    speed = usual_speeds(vehicle)
    return replace(laws, exponent=own if laws.exponent is None else laws.exponent + own - 2.0, speed=speed)


def _load(values: Values, vehicle: Vehicle) -> Lump:
    held = grasp(values["time"], vehicle)
    return Lump(values["mass"], _each(values, "xyz"), lift=values["buoyancy"], share=held)


def grasp(begin: float, vehicle: Vehicle) -> Callable[[float], tuple[float, float]]:
    """Return how far a load is held at a time, and its rate: a logistic curve of width 0.3 sqrt(L/g)."""
    width = 0.3 * np.sqrt(vehicle.length / vehicle.gravity)

    def held(t: float) -> tuple[float, float]:
        # By the hyperbolic tangent: it does not overflow long before or after.
        half = np.tanh(0.5 * (t - begin) / width)
        return float(0.5 * (1.0 + half)), float(0.25 * (1.0 - half * half) / width)

    return held
