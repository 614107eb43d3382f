"""Grey-box models of underwater vehicles: compare, see where it fails, name what is missing, add it."""

from __future__ import annotations

import sys

if sys.orig_argv[1:3] == ["-m", "auvnn"] and not sys.flags.safe_path:
    # Python put the folder where the user stands before everything else: what lies there is not to be run.
    import os

    if sys.path[:1] == [os.getcwd()] and not os.path.samefile(sys.path[0], os.path.dirname(__path__[0])):
        del sys.path[0]

import importlib
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

__all__ = [
    "GreyBox",
    "Log",
    "Vehicle",
    "adapt",
    "add",
    "advice",
    "check",
    "compare",
    "diagnose",
    "diagnose_files",
    "export",
    "fleet",
    "import_model",
    "improve",
    "load",
    "register_effect",
    "remove",
    "resid",
    "simulate",
    "train",
    "train_files",
]

if TYPE_CHECKING:
    from auvnn.comparison import compare
    from auvnn.comparison import compare as resid
    from auvnn.diagnosis import diagnose, diagnose_files
    from auvnn.effects.registering import register_effect
    from auvnn.exports import export
    from auvnn.imports import import_model
    from auvnn.improvement import add, fleet, improve
    from auvnn.logs import Log, check
    from auvnn.logs import check as advice
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
    "advice": "auvnn.logs:check",
    "check": "auvnn.logs",
    "compare": "auvnn.comparison",
    "diagnose": "auvnn.diagnosis",
    "diagnose_files": "auvnn.diagnosis",
    "export": "auvnn.exports",
    "fleet": "auvnn.improvement",
    "import_model": "auvnn.imports",
    "improve": "auvnn.improvement",
    "load": "auvnn.models",
    "register_effect": "auvnn.effects.registering",
    "remove": "auvnn.models",
    # By what users of MATLAB's System Identification Toolbox look for.
    "resid": "auvnn.comparison:compare",
    "simulate": "auvnn.simulation",
    "train": "auvnn.training",
    "train_files": "auvnn.training",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'auvnn' has no attribute '{name}'")
    module, _, attribute = _WHERE[name].partition(":")
    value = getattr(importlib.import_module(module), attribute or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
