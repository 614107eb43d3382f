"""Vehicles that no reader would accept: what the equations do with them is asked anyway."""

from __future__ import annotations

import copy
from typing import Any

from auvnn.vehicle import Vehicle


def unchecked(vehicle: Vehicle, **changes: Any) -> Vehicle:
    """Return a vehicle with some values changed that are not checked."""
    out = copy.copy(vehicle)
    for name, value in changes.items():
        object.__setattr__(out, name, value)
    return out
