"""The folder of a run: taken by one run at a time, and either complete or unchanged."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from auvnn.cli.runs.working import LOCK, WORK, cleared, is_marked, let_go, marked, refuse_foreign, take_away
from auvnn.errors import ConfigError

OURS = {WORK, ".hydra"}


def is_taken(path: Path) -> bool:
    """Say whether a folder holds anything but a run's own notes."""
    return path.is_dir() and any(entry.name not in OURS for entry in path.iterdir())


def refuse_taken(path: Path, *, overwrite: bool) -> None:
    """Refuse a place that cannot be written to, or in which something would be lost.

    Raises:
        ConfigError: the path is a file, may not be written to, or holds something already.
    """
    for place in (path, *path.parents):
        if os.path.lexists(place):
            if not place.is_dir():
                raise ConfigError(f"out={path}: {place} is not a folder; choose another place")
            if not os.access(place, os.W_OK | os.X_OK):
                raise ConfigError(f"out={path}: {place} must not be written to; choose another place")
            break
    if is_taken(path) and not overwrite:
        raise ConfigError(f"out={path}: is not empty; choose a new folder, or say overwrite=true")
    refuse_foreign(path)


@contextlib.contextmanager
def created(path: Path) -> Iterator[None]:
    """Make a folder with its parents, and take away again those that stay empty."""
    new = [place for place in (path, *path.parents) if not place.exists()]
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        for place in new:
            # Whatever holds something is kept: rmdir takes empty folders only.
            with contextlib.suppress(OSError):
                place.rmdir()


@contextlib.contextmanager
def locked(path: Path) -> Iterator[str]:
    """Hold a folder's lock, and give the id in the mark of its working folder; it falls with the process.

    Raises:
        ConfigError: another run holds it, or the working folder is not one of this program.
    """
    refuse_foreign(path)
    lock = path / WORK / LOCK
    stream = _hold(lock)
    if stream is None:
        raise ConfigError(f"out={path}: another run is writing there; wait for it or choose another folder")
    try:
        yield marked(path)
    finally:
        let_go(path)
        # Unlinked before it is let go: whoever waits for it finds another file there and tries again.
        with contextlib.suppress(OSError):
            lock.unlink()
        stream.close()
        with contextlib.suppress(OSError):
            (path / WORK).rmdir()


def _hold(lock: Path) -> IO[str] | None:
    try:
        import fcntl
    except ImportError:  # not POSIX: an exclusive file must do
        lock.parent.mkdir(exist_ok=True)
        try:
            return lock.open("x", encoding="ascii")
        except FileExistsError:
            return None
    while True:
        lock.parent.mkdir(exist_ok=True)
        try:
            stream = lock.open("a+", encoding="ascii")
        except FileNotFoundError:  # whoever held it has just taken the folder away
            continue
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.close()
            return None
        with contextlib.suppress(FileNotFoundError):
            if os.fstat(stream.fileno()).st_ino == lock.stat().st_ino:
                return stream
        stream.close()


@contextlib.contextmanager
def written(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """Give a fresh folder to write into; what it holds moves to `path` once all of it is there.

    Until then whatever `path` held stays as it is, and if the run fails it stays for good.
    """
    with created(path), locked(path) as mark:
        refuse_taken(path, overwrite=overwrite)
        new, old = path / WORK / "new", path / WORK / "old"
        _restore(old, path)
        take_away(new)
        new.mkdir()
        try:
            yield new
            if not is_marked(path, mark):
                raise ConfigError(
                    f"out={path}: {path / WORK} was exchanged during the run; run again elsewhere"
                )
            old.mkdir()
            for entry in sorted(new.iterdir()):
                target = path / entry.name
                if os.path.lexists(target) and (target.is_dir() or entry.is_dir()):
                    target.rename(old / entry.name)  # only files can be replaced in one step
                entry.replace(target)
            cleared(path, mark)  # also what an interrupted run would have gone on from
        except BaseException:
            if is_marked(path, mark):
                _restore(old, path)
            raise
        finally:
            if is_marked(path, mark):
                take_away(new)


def _restore(old: Path, path: Path) -> None:
    """Put back the folders that an ended run had moved aside and not replaced."""
    if old.is_dir():
        for entry in old.iterdir():
            if not os.path.lexists(path / entry.name):
                entry.rename(path / entry.name)
        take_away(old)
