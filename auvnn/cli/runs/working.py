"""The working folder of a run, `out/.auvnn`: marked as made by this program, and never a way out of `out`.

A folder that came from somebody else may hold links. Whatever is written or deleted here is therefore looked at
first: a link is never followed, and a folder that carries no mark of this program is never emptied.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import shutil
import stat
import uuid
from pathlib import Path

from auvnn.errors import ConfigError

WORK = ".auvnn"  # what a run needs while it runs: lock, unfinished files, the trace of a fault
LOCK = "lock"
MARK = "made-by-auvnn.json"


def refuse_foreign(out: Path) -> None:
    """Refuse a working folder that is a link, holds links, or that this program did not make; touch nothing.

    Args:
        out: the folder of the answer.

    Raises:
        ConfigError: with what is in the way.
    """
    work = out / WORK
    kind = _kind(work)
    if kind is None:
        return
    if kind != "folder":
        raise ConfigError(
            f"out={out}: {work} is a {kind}, not a folder of this program; remove it, or choose another place"
        )
    entries = sorted(work.iterdir())
    for entry in entries:
        if entry.is_symlink():
            raise ConfigError(
                f"out={out}: {entry} is a link, and none is followed; remove it, or choose another place"
            )
    if mark_of(out) is None and any(entry.name not in (LOCK, MARK) for entry in entries):
        raise ConfigError(
            f"out={out}: {work} was not made by this program, which would empty it; move it away, or choose another place"
        )


def refuse_links(root: Path, place: Path, *further: str) -> None:
    """Refuse links between the folder of many jobs and that of one of them, and among further names in `root`.

    Raises:
        ConfigError: naming the link.
    """
    between = [
        root.joinpath(*place.relative_to(root).parts[: n + 1])
        for n in range(len(place.relative_to(root).parts))
    ]
    for path in (*between, *(root / name for name in further)):
        if path.is_symlink():
            raise ConfigError(
                f"out={root}: {path} is a link, and none is followed; remove it, or choose another place"
            )


def mark_of(out: Path) -> str | None:
    """Return the id in the mark of the working folder below `out`; None where there is no mark."""
    file = out / WORK / MARK
    if _kind(file) != "file" or file.stat().st_size > 1000:
        return None
    try:
        found = json.loads(file.read_bytes())["id"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None
    return found if isinstance(found, str) and re.fullmatch(r"[0-9a-f]{32}", found) else None


def marked(out: Path) -> str:
    """Make the working folder below `out`, or take that of a former run, and return the id of its mark.

    Raises:
        ConfigError: see `refuse_foreign`.
    """
    (out / WORK).mkdir(parents=True, exist_ok=True)
    refuse_foreign(out)
    found = mark_of(out)
    if found is None:
        found = uuid.uuid4().hex
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | getattr(os, "O_NOFOLLOW", 0)
        with os.fdopen(os.open(out / WORK / MARK, flags, 0o644), "w", encoding="ascii") as stream:
            json.dump({"made_by": "auvnn", "id": found}, stream)
    return found


def cleared(out: Path, mark: str) -> None:
    """Empty the working folder but for lock and mark, if it still is the one that carries this mark."""
    if not is_marked(out, mark):
        return
    for entry in (out / WORK).iterdir():
        if entry.name not in (LOCK, MARK):
            take_away(entry)


def is_marked(out: Path, mark: str) -> bool:
    """Say whether the working folder still is the one that carries a mark: it may have been exchanged meanwhile."""
    return _kind(out / WORK) == "folder" and mark_of(out) == mark


def let_go(out: Path) -> None:
    """Take the working folder's mark away if there is nothing else in it; called while the lock is held."""
    with contextlib.suppress(OSError):
        if _kind(out / WORK) == "folder" and {entry.name for entry in (out / WORK).iterdir()} <= {LOCK, MARK}:
            (out / WORK / MARK).unlink(missing_ok=True)


def take_away(entry: Path) -> None:
    """Delete a file, a link itself, or a folder with what is in it; links in it are not followed."""
    if _kind(entry) == "folder":
        shutil.rmtree(entry, ignore_errors=True)
    else:
        entry.unlink(missing_ok=True)


def _kind(path: Path) -> str | None:
    try:
        mode = path.lstat().st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    if stat.S_ISLNK(mode):
        return "link"
    return "folder" if stat.S_ISDIR(mode) else "file" if stat.S_ISREG(mode) else "special file"
