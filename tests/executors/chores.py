"""Functions for workers: importable by name, some of them deadly."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from auvnn.errors import InputError


def power(shared: float, task: float) -> tuple[float, int]:
    return shared**task, os.getpid()


def once_deadly(shared: str, task: int) -> float:
    """Kill the worker the first time that task 3 comes along."""
    mark = Path(shared)
    if task == 3 and not mark.exists():
        mark.write_text(str(os.getpid()))
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.01 * (task % 3))
    return 1.0 / (1 + task)


def always_deadly(shared: Any, task: int) -> int:
    if task == 1:
        os._exit(9)
    return task


def refusing(shared: Any, task: int) -> int:
    if task == 2:
        raise InputError("task 2 has no samples")
    return task


def noisy(shared: Any, task: int) -> int:
    print("a library says something")
    return task
