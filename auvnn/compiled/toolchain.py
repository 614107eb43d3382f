"""The system's C compiler: found, run, and its results kept under the user's cache folder."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from auvnn.compiled import disk_cache
from auvnn.compiled.recorder import CannotCompile

FLAGS = ("-O2", "-std=gnu11", "-march=native", "-fPIC", "-shared", "-fno-math-errno", "-fno-trapping-math")
MOST = 512
"""Kernels that are kept; the ones that were not used for longest make room."""
LEFT = 86400.0
"""Seconds after which what a killed process left in the folder goes."""
TIMEOUT = 180.0
"""Seconds after which a compiler is given up."""


def compiler() -> str | None:
    """Return the C compiler: the environment's AUVNN_CC or CC, else cc, gcc or clang; None if there is none.

    AUVNN_CC=none says to do without.
    """
    named = os.environ.get("AUVNN_CC") or os.environ.get("CC")
    if named:
        return shutil.which(named)
    # A relative folder in PATH would be one of whoever gave us the current folder.
    path = os.pathsep.join(
        p for p in os.environ.get("PATH", os.defpath).split(os.pathsep) if os.path.isabs(p)
    )
    return next((found for name in ("cc", "gcc", "clang") if (found := shutil.which(name, path=path))), None)


def cache_folder() -> Path:
    """Return the folder that compiled code is kept in: AUVNN_CACHE, else auvnn/kernels under the user's cache."""
    own = os.environ.get("AUVNN_CACHE")
    if own:
        return Path(own)
    base = Path.home() / "Library/Caches" if sys.platform == "darwin" else Path.home() / ".cache"
    return Path(os.environ.get("XDG_CACHE_HOME") or base) / "auvnn" / "kernels"


@functools.lru_cache
def _machine(command: str) -> str:
    """Return what the machine code depends on besides the source: compiler, its version, processor."""
    version = subprocess.run(
        [command, "--version"], capture_output=True, text=True, timeout=30, check=False
    ).stdout
    try:
        info = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
        flags = next((line for line in info.splitlines() if line.startswith(("flags", "Features"))), "")
    except OSError:
        flags = platform.processor()
    return f"{command}\n{version}\n{platform.machine()}\n{flags}"


def key(source: str, lanes: int) -> str:
    """Return the name under which the code of a source is kept.

    Raises:
        CannotCompile: there is no compiler.
    """
    command = compiler()
    if command is None:
        raise CannotCompile("no C compiler (cc, gcc or clang) was found")
    text = "\n".join([source, str(lanes), *FLAGS, _machine(command)])
    return hashlib.sha256(text.encode()).hexdigest()[:40]


def is_kept(source: str, lanes: int) -> bool:
    """Return whether the code of a source is there already."""
    return disk_cache.looks_sound(cache_folder() / f"{key(source, lanes)}.so")


def build(source: str, lanes: int) -> tuple[ctypes.CDLL, float]:
    """Return the loaded code of a source, and the seconds that compiling took (zero where it was kept).

    Raises:
        CannotCompile: no compiler, or it fails, or its result cannot be loaded.
    """
    name = key(source, lanes)
    command = compiler()
    assert command is not None
    folder = cache_folder()
    disk_cache.private(folder)
    target, spent = folder / f"{name}.so", 0.0
    try:
        loaded = disk_cache.load(target)
        if loaded is None:
            begin = time.perf_counter()
            _compile(command, source, lanes, target)
            spent = time.perf_counter() - begin
            _make_room(folder)
            loaded = disk_cache.load(target)
    except OSError as error:
        disk_cache.forget(target)
        raise CannotCompile(f"compiled code cannot be loaded: {error}") from None
    if loaded is None:
        raise CannotCompile(f"{target}: is not what was compiled a moment ago; make {folder} private")
    with contextlib.suppress(OSError):
        os.utime(target)  # when it was used last
    return loaded, spent


def _make_room(folder: Path) -> None:
    """Remove what was not used for longest; another process may be at the same."""
    with contextlib.suppress(OSError):
        there = sorted(folder.glob("*.so"), key=lambda f: f.lstat().st_mtime)
        for old in there[:-MOST]:
            disk_cache.forget(old)
        for left in (*folder.glob(".loading-*"), *folder.glob("making-*")):
            if time.time() - left.lstat().st_mtime > LEFT:  # of a process that was killed
                shutil.rmtree(left) if left.is_dir() and not left.is_symlink() else left.unlink()


def _compile(command: str, source: str, lanes: int, target: Path) -> None:
    """Compile beside the target and move the result into place: another process sees all of it or nothing."""
    try:
        with tempfile.TemporaryDirectory(dir=target.parent, prefix="making-") as folder:
            text, made = Path(folder, "kernel.c"), Path(folder, "kernel.so")
            text.write_text(source, encoding="utf-8")
            done = subprocess.run(
                [command, *FLAGS, f"-DLANES={lanes}", "-o", str(made), str(text), "-lm"],
                capture_output=True,
                text=True,
                timeout=TIMEOUT,
                check=False,
            )
            if done.returncode:
                first = next((line for line in done.stderr.splitlines() if "error" in line), "no message")
                raise CannotCompile(f"{command} failed: {first.strip()[-200:]}")
            disk_cache.keep(made, target)
    except subprocess.TimeoutExpired:
        raise CannotCompile(f"{command} took longer than {TIMEOUT:g} s") from None
    except OSError as error:
        raise CannotCompile(f"the compiled code cannot be written: {error.strerror}") from None
