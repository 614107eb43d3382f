"""Grey-box models of underwater vehicles: compare, see where it fails, name what is missing, add it."""

from __future__ import annotations

import importlib
import sys
import types
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
    from pathlib import Path

    from auvnn.comparison import compare
    from auvnn.diagnosis import diagnose, diagnose_files
    from auvnn.improvement import add, fleet
    from auvnn.logs import Log
    from auvnn.logs.quality.quality import Quality
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
    "add": "auvnn.diagnosis",
    "compare": "auvnn.diagnosis",
    "diagnose": "auvnn.diagnosis",
    "diagnose_files": "auvnn.diagnosis",
    "fleet": "auvnn.diagnosis",
    "load": "auvnn.models",
    "remove": "auvnn.models",
    "simulate": "auvnn.simulation",
    "train": "auvnn.training",
    "train_files": "auvnn.training",
}


class _Package(types.ModuleType):
    """The package, in which a public name stays what it is when a module of that name is imported."""

    def __setattr__(self, name: str, value: Any) -> None:
        # Importing auvnn.simulate would put the module where the function belongs.
        if name not in _WHERE or not isinstance(value, types.ModuleType):
            super().__setattr__(name, value)


def check(log: Log | str | Path | list[str | Path], mapping: Any = None) -> Quality:
    """Return the quality report of a log, or of the files that it is to be read from.

    Args:
        log: a log, a CSV or Parquet file, or a list of files.
        mapping: for files, how their columns are named; see `Log.read`.
    """
    from auvnn.logs import Log as _Log

    return (log if isinstance(log, _Log) else _Log.read(log, mapping)).quality()


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'auvnn' has no attribute '{name}'")
    value = getattr(importlib.import_module(_WHERE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


sys.modules[__name__].__class__ = _Package
