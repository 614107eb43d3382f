"""Grey-box models of underwater vehicles: compare, see where it fails, name what is missing, add it."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

__all__ = [
    "GreyBox",
    "Log",
    "Vehicle",
    "adapt",
    "add",
    "check",
    "compare",
    "diagnose",
    "diagnose_files",
    "fleet",
    "load",
    "remove",
    "simulate",
    "train",
    "train_files",
]

if TYPE_CHECKING:
    from auvnn.comparison import compare
    from auvnn.diagnosis import diagnose, diagnose_files
    from auvnn.improvement import add, fleet
    from auvnn.logs import Log, check
    from auvnn.models import GreyBox, load, remove
    from auvnn.online import adapt
    from auvnn.simulation import simulate
    from auvnn.training import train, train_files
    from auvnn.vehicle import Vehicle

# Imported when first used: torch alone takes longer than any listing should.
_WHERE = {
    "GreyBox": "auvnn.models",
    "Log": "auvnn.logs",
    "Vehicle": "auvnn.vehicle",
    "adapt": "auvnn.online",
    "add": "auvnn.improvement",
    "check": "auvnn.logs",
    "compare": "auvnn.comparison",
    "diagnose": "auvnn.diagnosis",
    "diagnose_files": "auvnn.diagnosis",
    "fleet": "auvnn.improvement",
    "load": "auvnn.models",
    "remove": "auvnn.models",
    "simulate": "auvnn.simulation",
    "train": "auvnn.training",
    "train_files": "auvnn.training",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'auvnn' has no attribute '{name}'")
    value = getattr(importlib.import_module(_WHERE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
