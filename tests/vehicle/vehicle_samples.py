"""A valid vehicle that uses every key, for the tests to change."""

from __future__ import annotations

import copy
from typing import Any

_SAMPLE: dict[str, Any] = {
    "name": "sample",
    "frame": "FRD",
    "gravity": 9.81,
    "water_density": 1025.0,
    "mass": 62.0,
    "buoyancy": 608.22,
    "length": 1.0,
    "center_of_gravity": [0.01, -0.02, 0.045],
    "center_of_buoyancy": [0.0, 0.0, 0.0],
    "inertia": [[3.0, 0.1, -0.2], [0.1, 5.0, 0.05], [-0.2, 0.05, 6.0]],
    "added_mass": [
        [30.0, 1.0, 0.0, 0.0, 2.0, 0.0],
        [1.0, 50.0, 0.0, -3.0, 0.0, 4.0],
        [0.0, 0.0, 90.0, 0.0, -5.0, 0.0],
        [0.0, -3.0, 0.0, 2.0, 0.0, 0.1],
        [2.0, 0.0, -5.0, 0.0, 6.0, 0.0],
        [0.0, 4.0, 0.0, 0.1, 0.0, 5.0],
    ],
    "linear_damping": [
        [20.0, 0.0, 0.0, 0.0, 1.0, 0.0],
        [0.0, 25.0, 0.0, 2.0, 0.0, -6.0],
        [0.0, 0.0, 30.0, 0.0, 3.0, 0.0],
        [0.0, 2.0, 0.0, 4.0, 0.0, 0.0],
        [1.0, 0.0, -2.0, 0.0, 5.0, 0.0],
        [0.0, 1.5, 0.0, 0.0, 0.0, 6.0],
    ],
    "quadratic_damping": [
        [40.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 80.0, 0.0, 0.0, 0.0, -0.6],
        [0.0, 0.0, 90.0, 0.0, 0.6, 0.0],
        [0.0, 0.0, 0.0, 5.0, 0.0, 0.0],
        [0.0, 0.0, -3.0, 0.0, 9.0, 0.0],
        [0.0, 3.0, 0.0, 0.0, 0.0, 9.0],
    ],
    "damping_elements": [
        {
            "position": [0.1, 0.2, -0.3],
            "axes": [[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]],
            "linear": [1.0, 2.0, 3.0, 0.1, 0.2, 0.3],
            "quadratic": [4.0, 5.0, 6.0, 0.4, 0.5, 0.6],
        }
    ],
    "thrusters": [
        {
            "position": [-0.4, 0.2, 0.05],
            "direction": [2.0, 0.5, 0.25],
            "max_forward": 90.0,
            "max_reverse": 72.0,
            "curve": "quadratic",
            "handedness": -1,
        },
        {
            "position": [-0.4, -0.2, 0.05],
            "direction": [1.0, 0.0, 0.0],
            "curve": {"command": [-1.0, -0.1, 0.1, 1.0], "thrust": [-40.0, 0.0, 0.0, 50.0]},
        },
    ],
    "fins": [
        {
            "position": [-0.5, 0.1, 0.02],
            "axis": [0.0, 1.0, 0.5],
            "area": 0.01,
            "lift_slope": 3.0,
            "stall": 0.3,
        }
    ],
    "reference_voltage": 16.0,
    "uncertainty": {"added_mass": 0.2, "linear_damping": 0.3, "quadratic_damping": 0.3, "inertia": 0.1},
    "effects": {"ocean_current": {"v_north": 0.2, "v_east": -0.1}},
    "source": "made up for tests",
}


def sample(**changes: Any) -> dict[str, Any]:
    """Return a fresh valid vehicle with the given top-level values in place of its own."""
    return copy.deepcopy(_SAMPLE) | changes


def minimal() -> dict[str, Any]:
    """Return the keys that a vehicle cannot do without."""
    return {
        "name": "minimal",
        "mass": 50.0,
        "center_of_gravity": [0.0, 0.0, 0.02],
        "center_of_buoyancy": [0.0, 0.0, 0.0],
        "inertia": [2.0, 3.0, 4.0],
        "added_mass": [20.0, 40.0, 60.0, 1.0, 2.0, 3.0],
    }
