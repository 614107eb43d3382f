"""Folders that are whole and intact or refused: files and a manifest of their SHA-256, moved into place."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

from auvnn.errors import AuvnnError, InputError, ModelError
from auvnn.storage.manifest import CODE_SUFFIXES, MANIFEST, check_name, read_manifest
from auvnn.storage.removal import remove_own

SCHEMA = "auvnn/folder/1"


def write_folder(
    path: str | Path,
    files: Mapping[str, bytes | str],
    overwrite: bool = False,
    *,
    schema: str = SCHEMA,
    readable: Callable[[dict[str, bytes]], object] | None = None,
) -> Path:
    """Write files and their manifest into a new folder that appears whole or not at all.

    The files are written into a hidden folder beside `path`, flushed to the disk, and moved into place. A
    folder that is replaced is kept beside it under a hidden name until the new one stands, and is what
    `read_folder` reads if the program was killed between the two.

    Args:
        path: the folder to make; its parents are made too.
        files: plain file names and their content; text is written as UTF-8.
        overwrite: replace an existing folder of this kind. One that holds anything else is never replaced.
        schema: kind and version that the manifest states, "kind/number".
        readable: reads what was written, and raises where it cannot; called before anything that was there goes.

    Returns:
        The folder's path.

    Raises:
        InputError: the folder exists and is not empty, or a name is not a plain file name.
        ModelError: what was written cannot be read back; what was there is still there.
    """
    path = Path(path)
    for name in files:
        check_name(name, path)
    if MANIFEST in files:
        raise InputError(f"{path}: '{MANIFEST}' is written automatically: leave it out")
    content = {name: data.encode() if isinstance(data, str) else bytes(data) for name, data in files.items()}
    listing = {n: {"sha256": hashlib.sha256(d).hexdigest(), "bytes": len(d)} for n, d in content.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    _restore_previous(path)
    _check_target(path, overwrite)
    staged = Path(tempfile.mkdtemp(dir=path.parent, prefix=f".{path.name}.", suffix=".partial"))
    try:
        for name, data in content.items():
            _write_flushed(staged / name, data)
        manifest = json.dumps({"schema": schema, "files": listing}, indent=1, sort_keys=True)
        _write_flushed(staged / MANIFEST, manifest.encode())
        staged.chmod(0o755)
        _flush_folder(staged)
        _read_back(staged, content, path, schema, readable)
        previous = _previous(path)
        if path.is_dir():
            if any(path.iterdir()):
                os.replace(path, previous)
            else:
                path.rmdir()
        os.replace(staged, path)
        _flush_folder(path.parent)
    except BaseException:
        shutil.rmtree(staged, ignore_errors=True)
        _restore_previous(path)
        raise
    remove_own(_previous(path))
    return path


def _read_back(
    staged: Path,
    content: Mapping[str, bytes],
    path: Path,
    schema: str,
    readable: Callable[[dict[str, bytes]], object] | None,
) -> None:
    try:
        found = read_folder(staged, schema=schema)
        if found != content:
            raise ModelError("the disk holds something else than was written")
        if readable is not None:
            readable(found)
    except AuvnnError as error:
        raise ModelError(
            f"{path}: not saved, because it could not be read again ({error}); what was there is kept"
        ) from error


def folder_exists(path: str | Path) -> bool:
    """Return whether `read_folder` has something to read, a replacement that was cut short included."""
    path = Path(path)
    return path.is_dir() or (not path.exists() and _previous(path).is_dir())


def read_folder(path: str | Path, *, schema: str = SCHEMA) -> dict[str, bytes]:
    """Read a folder that `write_folder` wrote, after checking every file against the manifest.

    Args:
        path: the folder.
        schema: kind and newest version that the caller understands.

    Returns:
        File names and contents, the manifest left out. Files that the manifest does not name are not read.

    Raises:
        InputError: there is no such folder.
        ModelError: it is of another kind, newer, incomplete or damaged, or names a file that could run code.
    """
    path = Path(path)
    if not path.exists() and _previous(path).is_dir():
        path = _previous(path)
    if not path.exists():
        raise InputError(f"{path}: there is no such folder")
    if not path.is_dir():
        _refuse_file(path)
    manifest = read_manifest(path, schema)
    content: dict[str, bytes] = {}
    wrong: list[str] = []
    for name, entry in manifest.items():
        file = path / name
        if not file.is_file():
            wrong.append(f"{name} is missing")
            continue
        size = file.stat().st_size
        if size != entry["bytes"]:
            wrong.append(f"{name} has {size} bytes instead of {entry['bytes']}")
            continue
        data = file.read_bytes()
        if hashlib.sha256(data).hexdigest() != entry["sha256"]:
            wrong.append(f"{name} was changed or damaged after it was saved (its SHA-256 differs)")
            continue
        content[name] = data
    if wrong:
        raise ModelError(f"{path}: {'; '.join(wrong)}: restore the folder from a copy, or make it again")
    return content


def _check_target(path: Path, overwrite: bool) -> None:
    if not path.exists():
        return
    if not path.is_dir():
        raise InputError(f"{path}: a file of this name is in the way: choose another name")
    present = {file.name for file in path.iterdir()}
    if not present:
        return
    if not overwrite:
        raise InputError(f"{path}: the folder is not empty: choose another, or say overwrite=true")
    try:
        known = {MANIFEST, *json.loads((path / MANIFEST).read_bytes())["files"]}
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: not replaced, because it was not written by auvnn: choose another"
        ) from error
    foreign = sorted(present - known)
    if foreign:
        raise InputError(
            f"{path}: not replaced, because it also holds {', '.join(foreign[:5])}: move them away"
        )


def _refuse_file(path: Path) -> None:
    if path.suffix.lower() in (*CODE_SUFFIXES, ".zip", ".tar", ".gz"):
        raise ModelError(
            f"{path}: auvnn opens no pickles and no archives, which can run code: "
            "give a folder that auvnn saved"
        )
    raise ModelError(f"{path}: this is a file: give a folder that auvnn saved")


def _previous(path: Path) -> Path:
    return path.parent / f".{path.name}.previous"


def _restore_previous(path: Path) -> None:
    """Put back what a killed replacement had moved aside."""
    previous = _previous(path)
    if not previous.is_dir() or previous.is_symlink():
        remove_own(previous)
        return
    if path.exists():
        remove_own(previous)
    else:
        os.replace(previous, path)


def _write_flushed(path: Path, data: bytes) -> None:
    with open(path, "wb") as stream:
        stream.write(data)
        stream.flush()
        os.fsync(stream.fileno())


def _flush_folder(path: Path) -> None:
    if os.name == "nt":  # folders cannot be opened for flushing there
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
