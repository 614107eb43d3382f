"""What a process that we start may import: nothing that lies in the folder where the user stands.

A folder with a stranger's logs may also hold a `typing.py`. `python -m` and `python -c` put the current folder before
everything else, and so does an empty part of PYTHONPATH.

Reference: https://docs.python.org/3/using/cmdline.html#cmdoption-P
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

# Where this package was imported from is trusted, also if the user stands there (a checkout that is worked on).
_HOME = os.path.realpath(Path(__file__).parents[2])


def without_here(path: Iterable[str]) -> list[str]:
    """Return those folders of a search path that are not the current one."""
    try:
        here = os.path.realpath(os.getcwd())
    except OSError:  # the current folder is gone
        here = ""
    return [p for p in path if p and ((real := os.path.realpath(p)) != here or real == _HOME)]


def import_path() -> list[str]:
    """Return this process's search path without the current folder."""
    return without_here(sys.path)


def environment(*, path: bool = True) -> dict[str, str]:
    """Return the environment for another Python that is to find what this one finds, the current folder aside.

    Args:
        path: hand this process's search path down; otherwise the user's PYTHONPATH, its unsafe parts taken out.
    """
    own = {**os.environ, "PYTHONSAFEPATH": "1"}
    found = import_path() if path else without_here(os.environ.get("PYTHONPATH", "").split(os.pathsep))
    own.pop("PYTHONPATH", None)
    return own | ({"PYTHONPATH": os.pathsep.join(found)} if found else {})


def python(module: str, *words: str) -> list[str]:
    """Return the command that runs a module in another Python without the current folder in its search path."""
    return [sys.executable, "-P", "-m", module, *words]


def keep_safe() -> None:
    """Let neither this process, from now on, nor whatever it starts import from the current folder."""
    sys.path[:] = import_path()
    safe = environment(path=False)
    for name in ("PYTHONPATH", "PYTHONSAFEPATH"):
        os.environ.pop(name, None)
        if name in safe:
            os.environ[name] = safe[name]


@contextlib.contextmanager
def kept_safe() -> Iterator[None]:
    """Do the same as `keep_safe` for a while: for libraries that start processes without being asked."""
    names = ("PYTHONPATH", "PYTHONSAFEPATH")
    before, path = {name: os.environ.get(name) for name in names}, list(sys.path)
    keep_safe()
    try:
        yield
    finally:
        sys.path[:] = path
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def ray_job() -> Any:
    """Return the description of a Ray job whose processes do not have the current folder in their search path.

    Ray puts it there first, but for jobs of its client (`_client_job`), which hand their code over by themselves.
    """
    kind = importlib.import_module("ray.job_config").JobConfig
    return kind(_client_job=True, _py_driver_sys_path=[_HOME])


@contextlib.contextmanager
def ray_kept_safe() -> Iterator[None]:
    """Let whoever starts Ray in this process start such jobs: Hydra's launcher does, where it is installed."""
    try:
        there = importlib.util.find_spec("hydra_plugins.hydra_ray_launcher") is not None
    except ModuleNotFoundError:
        there = False
    if not there:
        yield
        return
    ray: Any = importlib.import_module("ray")
    begin = ray.init

    def init(*given: Any, **more: Any) -> Any:
        return begin(*given, **{"job_config": ray_job(), "logging_level": "ERROR", **more})

    ray.init = init
    try:
        yield
    finally:
        ray.init = begin
