"""Units and the small checks of a mapping file's entries."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError

_DEGREE = math.pi / 180.0


_G = 9.80665


UNITS: dict[str, float] = {
    "1": 1.0, "percent": 0.01, "rad": 1.0, "mrad": 1e-3, "deg": _DEGREE, "cdeg": 0.01 * _DEGREE,
    "rad/s": 1.0, "mrad/s": 1e-3, "deg/s": _DEGREE, "rev/s": 2.0 * math.pi, "rpm": 2.0 * math.pi / 60.0,
    "m": 1.0, "cm": 0.01, "mm": 1e-3, "km": 1e3, "ft": 0.3048, "fathom": 1.8288,
    "m/s": 1.0, "cm/s": 0.01, "mm/s": 1e-3, "km/h": 1.0 / 3.6, "kn": 1852.0 / 3600.0, "ft/s": 0.3048,
    "m/s2": 1.0, "cm/s2": 0.01, "g": _G, "mg": 1e-3 * _G,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "V": 1.0, "mV": 1e-3,
    "N": 1.0, "kN": 1e3, "kgf": _G, "lbf": 4.4482216152605, "N m": 1.0, "kN m": 1e3,
    "Pa": 1.0, "hPa": 100.0, "mbar": 100.0, "kPa": 1e3, "dbar": 1e4, "bar": 1e5, "psi": 6894.757293168361,
}  # fmt: skip


def unit_factor(unit: Any, here: str) -> float:
    """Return what turns a unit into SI.

    Raises:
        ConfigError: an unknown unit.
    """
    if not isinstance(unit, str) or unit not in UNITS:
        raise ConfigError(f"{here}: {unknown_name('unit', str(unit), UNITS)}")
    return UNITS[unit]


def _known(data: Mapping[str, Any], keys: tuple[str, ...], here: str) -> None:
    for key in data:
        if key not in keys:
            raise ConfigError(f"{here}: {unknown_name('key', str(key), keys)}")


def _truth(value: Any, here: str) -> bool:
    if not isinstance(value, bool):
        raise ConfigError(f"{here}: must be true or false, not {value!r}")
    return value


def _number(value: Any, here: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ConfigError(f"{here}: {value!r} is not a finite number")
    return float(value)
