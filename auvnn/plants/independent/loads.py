"""Effects that are forces: each a function of its parameters and the moment, to force and moment at the origin."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.plants.independent.sizes import own_drag
from auvnn.plants.independent.vectors import cross
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]
Values = Mapping[str, float]
Load = tuple[Array, Array]

# Points at which the cross flow is summed along the hull.
STATIONS = 48


@dataclass(frozen=True)
class Instant:
    """Everything that a force may depend on; SI, NED and FRD, (R, ...).

    Attributes:
        vehicle: its plain numbers.
        t: s.
        place: NED, m, (R, 3).
        rotation: body to NED, (R, 3, 3).
        down: its third row, the direction of down in the body, (R, 3).
        v: velocity over ground, (R, 3).
        turn: angular rate, (R, 3).
        flow: velocity through the water, (R, 3).
        dragged: the same, as the drag feels it, (R, 3).
        command: (R, n).
        buoyancy: N, of the hull with what effects make of it.
        cb: its centre, m, (3,).
        stretch: A33 - A11 and A22 - A11, kg, (R,) each, of the added mass as it is at the moment.
        separation: share of the hull's lift that fades as the hull turns broadside.
    """

    vehicle: Vehicle
    t: float
    place: Array
    rotation: Array
    down: Array
    v: Array
    turn: Array
    flow: Array
    dragged: Array
    command: Array
    buoyancy: float
    cb: Array
    stretch: tuple[Array, Array]
    separation: float = 0.0

    def to_body(self, vector: Array) -> Array:
        """Turn a world vector (R, 3) into body axes."""
        return np.einsum("rij,ri->rj", self.rotation, vector)


def _columns(*parts: Array | float) -> Array:
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def constant(values: Values, at: Instant) -> Load:
    """A wrench that stays the same in the body."""
    force, moment = (np.array([values[n] for n in names]) for names in ("XYZ", "KMN"))
    return np.broadcast_to(force, at.v.shape), np.broadcast_to(moment, at.v.shape)


def lift(values: Values, at: Instant) -> Load:
    """Forces and moments of the hull in u v and u w."""
    u, v, w = at.flow.T
    ahead = u * u / np.maximum(u * u + v * v + w * w, 1e-12)
    u = u * (1.0 - at.separation * (1.0 - ahead))
    return (
        _columns(0.0, values["Yuv"] * u * v, values["Zuw"] * u * w),
        _columns(0.0, values["Muw"] * u * w, values["Nuv"] * u * v),
    )


def munk(values: Values, at: Instant) -> Load:
    """What the hull's moment differs by from the ideal (A33 - A11) u w in pitch and -(A22 - A11) u v in yaw."""
    u, v, w = at.flow.T
    pitch, yaw = at.stretch[0] * u * w, -at.stretch[1] * u * v
    return np.zeros_like(at.v), _columns(0.0, (values["pitch"] - 1) * pitch, (values["yaw"] - 1) * yaw)


def turning(values: Values, at: Instant) -> Load:
    """Products of speed and turn rate."""
    u, v, w = at.flow.T
    p, q, r = at.turn.T
    force = _columns(
        values["Xvr"] * v * r + values["Xwq"] * w * q,
        values["Yur"] * u * r + values["Ywp"] * w * p,
        values["Zuq"] * u * q + values["Zvp"] * v * p,
    )
    moment = _columns(
        values["Kwq"] * w * q + values["Kvr"] * v * r,
        values["Muq"] * u * q + values["Mvp"] * v * p,
        values["Nur"] * u * r + values["Nwp"] * w * p,
    )
    return force, moment


def cross_flow(values: Values, at: Instant) -> Load:
    """A share of the sideways drag, moved from the origin to stations along the hull.

    Each station sees the velocity of its own point, and drags against its part across the hull's axis; the
    moment is the arm times that force. What the same share does at the origin is taken off.
    """
    x, weight = 0.5 * at.vehicle.length * _STATIONS[0], _STATIONS[1]
    drag = own_drag(at.vehicle)[1:]
    # With the arm (x, 0, 0), w x r is (0, r x, -q x); across the hull it adds to v and w.
    y, z = at.dragged[:, 1:2] + at.turn[:, 2:] * x, at.dragged[:, 2:] - at.turn[:, 1:2] * x
    speed = np.hypot(y, z) * weight
    y, z = -drag[0] * speed * y, -drag[1] * speed * z
    # What the diagonal drag at the origin did.
    centre = -drag * np.abs(at.dragged[:, 1:]) * at.dragged[:, 1:]
    share = values["share"]
    force = _columns(0.0, y.sum(-1) - centre[:, 0], z.sum(-1) - centre[:, 1])
    return share * force, share * _columns(0.0, -(z @ x), y @ x)


_GAUSS = np.polynomial.legendre.leggauss(STATIONS)
_STATIONS = (_GAUSS[0], 0.5 * _GAUSS[1])


def compressible(values: Values, at: Instant) -> Load:
    """Buoyancy lost with depth: a weight at the centre of buoyancy."""
    force = values["per_metre"] * at.place[:, 2:] * at.buoyancy * at.down
    return force, cross(np.broadcast_to(at.cb, force.shape), force)


def tether(values: Values, at: Instant) -> Load:
    """A straight cable: it pulls when taut, half of it hangs on the vehicle, and it drags along; where it is fast."""
    arm = np.broadcast_to([values.get(n, 0.0) for n in "xyz"], at.place.shape)
    away = (
        at.place
        + np.einsum("rij,rj->ri", at.rotation, arm)
        - np.array([values["north"], values["east"], values["down"]])
    )
    length = np.linalg.norm(away, axis=-1, keepdims=True)
    taut = np.maximum(length - values["slack"], 0.0)
    towards = -away / np.maximum(length, 1e-9)
    pull = values["stiffness"] * taut * towards
    pull[:, 2:] += 0.5 * values["weight"] * length
    through = at.dragged + cross(at.turn, arm)
    speed = np.linalg.norm(through, axis=-1, keepdims=True)
    force = at.to_body(pull) - values["drag"] * length * speed * through
    return force, cross(arm, force)


def froude_krylov(values: Values, at: Instant) -> Load:
    """The waves' pressure on the displaced water: its mass times the water's local acceleration, at its centre."""
    from auvnn.plants.independent.water import waves

    _, acceleration = waves(values, at.vehicle, at.t, at.place, at.v)
    force = at.buoyancy / at.vehicle.gravity * at.to_body(acceleration)
    return force, cross(np.broadcast_to(at.cb, force.shape), force)


LOADS: dict[str, Callable[[Values, Instant], Load]] = {
    "constant_force": constant,
    "body_lift": lift,
    "munk_moment": munk,
    "turning_forces": turning,
    "cross_flow_drag": cross_flow,
    "compressibility": compressible,
    "tether": tether,
    "waves": froude_krylov,
}

__all__ = ["LOADS", "STATIONS", "Instant", "Load"]
