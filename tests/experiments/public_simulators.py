"""The modules of the study on public simulators, for its tests: they stand outside of the package."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[2] / "experiments" / "public_simulator"
VEHICLES = ("remus", "bluerov2", "girona500")
MODULES = ("run", "logged", *VEHICLES, *(f"{vehicle}_changes" for vehicle in VEHICLES), "BlueROV2")


@contextmanager
def studied(*checkouts: Path) -> Iterator[Any]:
    """Give the study's script as a module, and forget it and what it has imported afterwards.

    Args:
        checkouts: folders that the study puts into the search path.
    """
    before = set(sys.modules)
    sys.path.insert(0, str(HERE))
    try:
        # Other studies have a script of that name, too.
        sys.modules.pop("run", None)
        import run

        yield run
    finally:
        sys.path[:] = [p for p in sys.path if p not in {str(HERE), *map(str, checkouts)}]
        for name in set(sys.modules) - before | {"run"}:
            if name in MODULES or name.startswith("python_vehicle_simulator"):
                sys.modules.pop(name, None)
