"""Machine code on the disk: run only if it is ours, private, whole, and what was written.

Beside `NAME.so` stands `NAME.sha256`, the hash of its content. Code without it, or with another hash, of another
owner, that others may write to, or behind a link, is made again and never loaded: a file that was cut short would end
the process with SIGBUS when it is run.
"""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import os
import stat
import tempfile
from pathlib import Path

from auvnn.compiled.recorder import CannotCompile

MOST_BYTES = 64_000_000


def private(folder: Path) -> None:
    """Make the folder of kept code, or look at the one that is there.

    Raises:
        CannotCompile: it cannot be made, or others could put code there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        loose = not _own(folder.stat()) or next(
            (p for p in folder.resolve().parents if _open_to_all(p)), None
        )
    except OSError as error:
        raise CannotCompile(f"the cache folder {folder} cannot be made: {error.strerror}") from None
    if loose:
        place = folder if loose is True else loose
        raise CannotCompile(f"{place} can be written by others, who could put code there: make it private")


def looks_sound(code: Path) -> bool:
    """Say whether a file of code and its hash are there and nobody else's, without reading them."""
    return all(_plain(path) for path in (code, _hash_of(code)))


def load(code: Path) -> ctypes.CDLL | None:
    """Load a file of code; None where it must not be run.

    What is loaded is a copy of the content that was checked, without a name: nobody can exchange it after the check,
    and nobody can cut it short while it is in use.

    Raises:
        OSError: it is no code for this machine.
    """
    content = _read(code, MOST_BYTES) if looks_sound(code) else None
    if content is None or _read(_hash_of(code), 100) != _digest(content):
        return None
    handle, copy = tempfile.mkstemp(dir=code.parent, prefix=".loading-", suffix=".so")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
        os.chmod(copy, 0o700)
        return ctypes.CDLL(copy)
    finally:
        with contextlib.suppress(OSError):  # where open files cannot be removed it goes with the folder
            os.unlink(copy)


def keep(made: Path, code: Path) -> None:
    """Move compiled code and its hash into place, flushed to the disk; what stood there is replaced, a link itself.

    Raises:
        OSError: the disk is full, or a folder is in the way.
    """
    content = made.read_bytes()
    digest = _digest(content)
    assert digest is not None
    # A crash between the two leaves code with another hash, which is made again.
    _replace(_hash_of(code), digest, 0o600)
    _replace(code, content, 0o700)


def forget(code: Path) -> None:
    """Remove a file of code and its hash."""
    with contextlib.suppress(OSError):
        code.unlink(missing_ok=True)
        _hash_of(code).unlink(missing_ok=True)


def _hash_of(code: Path) -> Path:
    return code.with_suffix(".sha256")


def _digest(content: bytes | None) -> bytes | None:
    return None if content is None else hashlib.sha256(content).hexdigest().encode()


def _plain(path: Path) -> bool:
    try:
        status = path.lstat()
    except OSError:
        return False
    # A second name for the file would let whoever has it write there.
    return stat.S_ISREG(status.st_mode) and status.st_nlink == 1 and _own(status)


def _own(status: os.stat_result) -> bool:
    return not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)


def _open_to_all(folder: Path) -> bool:
    mode = folder.stat().st_mode
    return bool(mode & stat.S_IWOTH and not mode & stat.S_ISVTX)


def _read(path: Path, most: int) -> bytes | None:
    """Return a file's content, read through a handle that cannot lead elsewhere; None where that fails."""
    try:
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
        with os.fdopen(handle, "rb") as stream:
            content = stream.read(most + 1)
    except OSError:
        return None
    return content if len(content) <= most else None


def _replace(path: Path, content: bytes, mode: int) -> None:
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        os.chmod(temporary, mode)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise
