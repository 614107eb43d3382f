"""A small vehicle's file that is right, for a test to spoil."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from auvnn.config import write_yaml


def four(**changes: Any) -> dict[str, Any]:
    """A vehicle with four thrusters, as the good log has them; None takes a key away."""
    data: dict[str, Any] = {
        "name": "four",
        "mass": 50.0,
        "buoyancy": 490.5,
        "length": 0.6,
        "center_of_gravity": [0.0, 0.0, 0.03],
        "center_of_buoyancy": [0.0, 0.0, 0.0],
        "inertia": [2.0, 2.5, 3.0],
        "added_mass": [20.0, 30.0, 40.0, 1.0, 1.5, 2.0],
        "linear_damping": [10.0, 15.0, 20.0, 1.0, 1.5, 2.0],
        "quadratic_damping": [40.0, 60.0, 80.0, 4.0, 5.0, 6.0],
        "thrusters": [
            {
                "position": [x, y, 0.0],
                "direction": [1.0, y, 0.2 * x],
                "max_forward": 40.0,
                "max_reverse": 40.0,
            }
            for x in (0.2, -0.2)
            for y in (0.2, -0.2)
        ],
        "uncertainty": dict.fromkeys(("added_mass", "linear_damping", "quadratic_damping", "inertia"), 0.1),
    } | changes
    return {key: value for key, value in data.items() if value is not None}


def put(file: str = "four.yaml", **changes: Any) -> str:
    """Write the vehicle's file here and return its name."""
    write_yaml(Path(file), four(**changes))
    return file
