"""A vehicle that is built in Python, held to what a model file is held to, at once."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from auvnn.errors import ModelError
from auvnn.vehicle import checks
from auvnn.vehicle.fields import Fields, shown
from auvnn.vehicle.parts import DampingElement, Fin, Thruster
from auvnn.vehicle.reading import KEYS, check_words
from auvnn.vehicle.reading_parts import read_element, read_fin, read_thruster

if TYPE_CHECKING:
    from auvnn.vehicle.vehicle import Vehicle

_PARTS = {
    "damping_elements": (DampingElement, read_element),
    "thrusters": (Thruster, read_thruster),
    "fins": (Fin, read_fin),
}


def validate(vehicle: Vehicle) -> None:
    """Refuse what is not physical, and write diagonals out as matrices; numbers are taken as FRD.

    Raises:
        ModelError: one line that names the field, the value and the cure.
    """
    where = vehicle.name if isinstance(vehicle.name, str) and vehicle.name else "vehicle"
    fields = Fields({k: getattr(vehicle, k) for k in KEYS if k != "frame"}, where, "vehicle", KEYS)
    check_words(fields)
    for name in ("gravity", "water_density", "mass", "buoyancy", "length"):
        object.__setattr__(vehicle, name, fields.positive(name))
    for name in ("center_of_gravity", "center_of_buoyancy"):
        object.__setattr__(vehicle, name, fields.array(name, (3,)))
    _set(vehicle, "inertia", checks.symmetrized(fields.matrix("inertia", 3), where, "inertia"))
    checks.check_inertia(vehicle.inertia, where)
    _set(vehicle, "added_mass", checks.symmetrized(fields.matrix("added_mass", 6), where, "added_mass"))
    for name, check in (
        ("linear_damping", checks.check_linear_damping),
        ("quadratic_damping", checks.check_quadratic_damping),
    ):
        if fields.has(name):
            _set(vehicle, name, fields.matrix(name, 6))
            check(getattr(vehicle, name), where)
    for name, (kind, read) in _PARTS.items():
        object.__setattr__(vehicle, name, _parts(getattr(vehicle, name), f"{where}: {name}", kind, read))
    checks.check_added_mass(vehicle.added_mass, vehicle.rigid_body, where)


def _set(vehicle: Vehicle, name: str, matrix: Any) -> None:
    """Keep a matrix, and the array that was given where it says the same."""
    given = getattr(vehicle, name)
    if not (isinstance(given, np.ndarray) and given.shape == matrix.shape and (given == matrix).all()):
        object.__setattr__(vehicle, name, matrix)


def _parts(given: Any, where: str, kind: type, read: Any) -> tuple[Any, ...]:
    """Return the parts, those written as in a model file read; the others are held to the same checks."""
    if not isinstance(given, Iterable) or isinstance(given, (str, bytes, dict)):
        raise ModelError(f"{where} is {shown(given)}: not a list; give a list of {kind.__name__}")
    out = []
    for i, part in enumerate(given):
        plain = part.to_dict() if isinstance(part, kind) else part
        made = read(plain, f"{where}[{i}]", np.eye(3))
        out.append(part if isinstance(part, kind) else made)
    return tuple(out)
