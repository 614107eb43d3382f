"""The parts of a vehicle from a model file: drag elements, thrusters and fins."""

from __future__ import annotations

from typing import Any

import numpy as np

from auvnn.vehicle.fields import Fields
from auvnn.vehicle.parts import Array, DampingElement, Fin, Thruster, ThrustTable


def turned(turn: Array, vector: Array) -> Array:
    """Return vectors (3,), or those in the columns of a matrix, in the frame that `turn` leads to."""
    # Adding zero makes -0.0 a plain 0.0: a file that was turned reads like one that was not.
    return turn @ vector + 0.0


def read_element(data: Any, where: str, turn: Array) -> DampingElement:
    """Return a displaced drag element; `turn` (3, 3) takes its frame to FRD.

    Args:
        data: of the element.
        where: it stands, for messages.
        turn: from its frame to FRD, (3, 3).
    """
    fields = Fields(data, where, "damping element", ("position", "axes", "linear", "quadratic"))
    axes = fields.array("axes", (3, 3)) if fields.has("axes") else np.eye(3)
    if np.abs(axes.T @ axes - np.eye(3)).max() > 1e-6 or np.linalg.det(axes) < 0:
        raise fields.refuse("axes", "not a rotation", "give three perpendicular right-handed unit columns")
    drag = {}
    for key in ("linear", "quadratic"):
        drag[key] = fields.array(key, (6,)) if fields.has(key) else np.zeros(6)
        if (drag[key] < 0).any():
            raise fields.refuse(key, "adds energy", "drag is positive: turn the negative signs")
    position = turned(turn, fields.array("position", (3,)))
    return DampingElement(position, turned(turn, axes), drag["linear"], drag["quadratic"])


def read_thruster(data: Any, where: str, turn: Array) -> Thruster:
    """Return a thruster; `turn` (3, 3) takes its frame to FRD.

    Args:
        data: of the thruster.
        where: it stands, for messages.
        turn: from its frame to FRD, (3, 3).
    """
    known = ("position", "direction", "max_forward", "max_reverse", "curve", "handedness")
    fields = Fields(data, where, "thruster", known)
    curve = fields.raw("curve") if fields.has("curve") else "quadratic"
    if isinstance(curve, str):
        if curve != "quadratic":
            raise fields.refuse(
                "curve", "not a known curve", "use quadratic or {command: [...], thrust: [...]}"
            )
        limits = fields.positive("max_forward"), fields.number("max_reverse")
    else:
        curve = _table(curve, f"{where}: curve")
        limits = float(curve.thrust.max()), max(0.0, -float(curve.thrust.min()))
        for key, limit in zip(("max_forward", "max_reverse"), limits, strict=True):
            if abs(fields.number(key, limit) - limit) > 1e-6 * max(1.0, limit):
                raise fields.refuse(key, f"but the curve reaches {limit:g} N", "state one of the two")
    if limits[1] < 0:
        raise fields.refuse("max_reverse", "must be positive", "give its size in N, without a sign")
    handedness = fields.number("handedness", 1.0)
    if handedness not in (-1.0, 0.0, 1.0):
        raise fields.refuse("handedness", "not a sense of rotation", "use 1, -1, or 0 for no reaction torque")
    position, direction = fields.array("position", (3,)), fields.unit("direction")
    return Thruster(turned(turn, position), turned(turn, direction), *limits, curve, int(handedness))


def _table(data: Any, where: str) -> ThrustTable:
    fields = Fields(data, where, "thrust curve", ("command", "thrust"))
    command = fields.array("command", (0,))
    thrust = fields.array("thrust", (0,))
    if len(command) < 2 or len(command) != len(thrust):
        raise fields.refuse(
            "thrust",
            f"{len(thrust)} numbers for {len(command)} commands",
            "give as many of both, at least two",
        )
    if not (np.diff(command) > 0).all():
        raise fields.refuse("command", "does not increase", "sort the table by command, each command once")
    if np.abs(command).max() > 1.0:
        raise fields.refuse("command", "goes beyond [-1, 1]", "scale the commands to [-1, 1]")
    if not thrust.max() > 0 or thrust[-1] < thrust[0]:
        raise fields.refuse(
            "thrust",
            "does not push along direction for positive commands",
            "turn the signs of the table, or the direction",
        )
    return ThrustTable(command, thrust)


def read_fin(data: Any, where: str, turn: Array) -> Fin:
    """Return a fin; `turn` (3, 3) takes its frame to FRD.

    Args:
        data: of the fin.
        where: it stands, for messages.
        turn: from its frame to FRD, (3, 3).
    """
    fields = Fields(data, where, "fin", ("position", "axis", "area", "lift_slope", "stall"))
    stall = fields.positive("stall", 0.26)
    if stall > np.pi / 2:
        raise fields.refuse("stall", "more than a right angle", "give it in radians")
    axis = fields.unit("axis")
    if abs(axis[0]) > 0.99:
        raise fields.refuse(
            "axis", "lies along x, so the fin never meets the flow", "give the shaft it turns about"
        )
    return Fin(
        turned(turn, fields.array("position", (3,))),
        turned(turn, axis),
        fields.positive("area"),
        fields.positive("lift_slope"),
        stall,
    )
