"""Deleting folders that `write_folder` made: a link is never followed, and what holds anything else is kept."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Collection
from pathlib import Path

from auvnn.errors import InputError
from auvnn.storage.manifest import MANIFEST, SUFFIXES


def remove_own(folder: Path, known: Collection[str] | None = None) -> None:
    """Delete a folder of ours; where a link stands, the link alone.

    Args:
        folder: to delete; nothing is done where there is none.
        known: names of the files that it may hold besides the manifest; by default those that its manifest lists.

    Raises:
        InputError: it holds something else, which is kept.
    """
    if folder.is_symlink():
        folder.unlink()
        return
    if not folder.is_dir():
        return
    foreign = foreign_in(folder, known)
    if foreign:
        raise InputError(
            f"{folder}: not deleted, because it also holds {', '.join(foreign[:5])}: move them away"
        )
    shutil.rmtree(folder, ignore_errors=True)


def remove_unfinished(folder: Path) -> None:
    """Delete what a killed `write_folder` left, if it holds nothing but files of the kinds that it writes."""
    if folder.is_symlink() or not folder.is_dir():
        return
    with contextlib.suppress(OSError):
        if all(f.suffix.lower() in SUFFIXES and f.is_file() and not f.is_symlink() for f in folder.iterdir()):
            shutil.rmtree(folder, ignore_errors=True)


def foreign_in(folder: Path, known: Collection[str] | None = None) -> list[str]:
    """Return the names in a folder that its manifest, or `known`, does not list."""
    present = {file.name for file in folder.iterdir()}
    if known is None:
        try:
            known = set(json.loads((folder / MANIFEST).read_bytes())["files"])
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            known = set()
    return sorted(present - {MANIFEST, *known})
