"""The canonical columns of a log: names, groups and units."""

from __future__ import annotations

import re

QUATERNION = ("qw", "qx", "qy", "qz")
EULER = ("phi", "theta", "psi")
VELOCITY = ("u", "v", "w", "p", "q", "r")
ACCELERATION = ("du", "dv", "dw", "dp", "dq", "dr")
POSITION = ("x", "y", "z")
WRENCH = ("tau_X", "tau_Y", "tau_Z", "tau_K", "tau_M", "tau_N")
SCALARS = ("altitude", "voltage", "ballast", "density", "moving_mass")
DRIVES = ("ballast", "moving_mass")
"""What moves a vehicle without thrusters: a volume that changes, m3, larger is lighter; the shift of a mass, m."""
RESET = "reset"
"""Counter of the estimator's resets, or number of its core: where it changes, the pose starts again."""
FIXED = ("run", "t", *EULER, *QUATERNION, *VELOCITY, *ACCELERATION, *POSITION, *WRENCH, *SCALARS, RESET)

_NUMBERED = re.compile(r"(thruster|fin)_([1-9][0-9]*)")
_UNITS = {
    "run": "1",
    "t": "s",
    **dict.fromkeys(EULER, "rad"),
    **dict.fromkeys(QUATERNION, "1"),
    **dict.fromkeys(VELOCITY[:3], "m/s"),
    **dict.fromkeys(VELOCITY[3:], "rad/s"),
    **dict.fromkeys(ACCELERATION[:3], "m/s2"),
    **dict.fromkeys(ACCELERATION[3:], "rad/s2"),
    **dict.fromkeys(POSITION, "m"),
    **dict.fromkeys(WRENCH[:3], "N"),
    **dict.fromkeys(WRENCH[3:], "N m"),
    "altitude": "m",
    "voltage": "V",
    "ballast": "m3",
    "density": "kg/m3",
    "moving_mass": "m",
    RESET: "1",
}


def is_canonical(name: str) -> bool:
    """Say whether a column name belongs to the contract."""
    return name in _UNITS or _NUMBERED.fullmatch(name) is not None


def unit(name: str) -> str | None:
    """Return the unit of a canonical column ("1" for a pure number), None for any other column."""
    numbered = _NUMBERED.fullmatch(name)
    if numbered:
        return "1" if numbered[1] == "thruster" else "rad"
    return _UNITS.get(name)


def numbered(kind: str, names: object) -> list[str]:
    """Return the columns `kind_1`, `kind_2`, ... present in `names`, in the order of their numbers."""
    found = [m for m in map(_NUMBERED.fullmatch, names) if m and m[1] == kind]  # type: ignore[call-overload]
    return [m[0] for m in sorted(found, key=lambda m: int(m[2]))]
