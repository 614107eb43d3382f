"""A checksum beside a log, `LOG.sha256`, in the form that `sha256sum -c` reads: from then on damage is seen.

Parquet files of other programs seldom carry checksums, and CSV files never do: a flipped bit in a number is another
number. `auvnn check seal=true` writes the file; a CSV file that `Log.write` wrote carries one from the start.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from auvnn.answers import write_text
from auvnn.errors import InputError

SUFFIX = ".sha256"


def seal_of(path: Path) -> Path:
    """Return where the seal of a log lies."""
    return path.with_name(path.name + SUFFIX)


def write_seal(path: Path, digest: str) -> Path:
    """Write the SHA-256 of a log beside it.

    Raises:
        InputError: it cannot be written.
    """
    place = seal_of(path)
    try:
        # Two blanks, as sha256sum writes it; names with line breaks it would have to escape.
        return write_text(place, f"{digest}  {path.name}\n")
    except OSError as problem:
        raise InputError(f"{place}: cannot be written: {problem.strerror}") from None


def sealed(path: Path) -> str | None:
    """Return the SHA-256 that a log must have; None where it has no seal.

    Raises:
        InputError: the seal cannot be read, or is none.
    """
    place = seal_of(path)
    try:
        with place.open("rb") as stream:
            text = stream.read(10_000)
    except FileNotFoundError:
        return None
    except OSError as problem:
        raise InputError(f"{place}: cannot be read: {problem.strerror}") from None
    found = re.match(rb"\\?([0-9a-f]{64})[ \t]", text)
    if found is None:
        raise InputError(
            f"{place}: holds no checksum; seal the log again (auvnn check seal=true), or remove it"
        )
    return found[1].decode()


def compare(path: Path, digest: str) -> bool:
    """Compare a log with its seal, if it has one, and say whether it has.

    Args:
        path: of the log.
        digest: SHA-256 of its bytes as they were read.

    Raises:
        InputError: they differ.
    """
    wanted = sealed(path)
    if wanted is not None and wanted != digest:
        raise InputError(
            f"{path}: differs from its seal {seal_of(path).name}: damaged, or edited after it was sealed; "
            "copy it again, or, if the change was meant, remove the seal"
        )
    return wanted is not None


def file_hash(path: Path, most: int | None = None) -> str:
    """Return the SHA-256 of a file's bytes, or of the first so many of them.

    Raises:
        InputError: it cannot be read.
    """
    try:
        with path.open("rb") as stream:
            if most is None:
                return hashlib.file_digest(stream, "sha256").hexdigest()
            return hashlib.sha256(stream.read(most)).hexdigest()
    except OSError as problem:
        raise InputError(f"{path}: disappeared while it was read: {problem}") from None
