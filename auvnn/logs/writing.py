"""Write a log with canonical columns; what is written reads back as it was."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from auvnn.errors import ConfigError, InputError, one_line, refuse_device
from auvnn.logs.seal import file_hash, seal_of, write_seal

if TYPE_CHECKING:
    import polars as pl

    from auvnn.logs.log import Log

HASH_KEY = "auvnn.sha256"


def frame_hash(frame: pl.DataFrame) -> str:
    """Return the SHA-256 of a table of numbers: column names and the bytes of their float64 values."""
    digest = hashlib.sha256()
    for series in frame:
        digest.update(series.name.encode())
        digest.update(frame_bytes(series))
    return digest.hexdigest()


def frame_bytes(series: pl.Series) -> bytes:
    """Return the bytes of a column's float64 values, as they count in the hash."""
    return np.ascontiguousarray(series.to_numpy(), dtype=np.float64).tobytes()


def to_frame(log: Log) -> pl.DataFrame:
    """Return the log as one table, `run` first, then the canonical columns, then the others."""
    import polars as pl

    names: dict[str, None] = {}
    for run in log.runs:
        names.update(dict.fromkeys(name for name, _ in run.columns()))
    data = {"run": np.repeat([r.number for r in log.runs], [r.samples for r in log.runs])}
    per_run = [dict(run.columns()) for run in log.runs]
    for name in names:
        parts = [c.get(name, np.full(r.samples, np.nan)) for c, r in zip(per_run, log.runs, strict=True)]
        data[name] = np.concatenate(parts)
    return pl.DataFrame(data)


def write(log: Log, path: Path, overwrite: bool) -> Path:
    """Write the log to `path`, whole or not at all.

    Args:
        log: that is written.
        path: with the suffix that decides the format.
        overwrite: replace a file that is there.

    Raises:
        InputError: the file is there already and `overwrite` is false, or it cannot be written.
        ConfigError: the name ends in none of `.parquet`, `.csv`, `.mcap`.
    """
    if path.suffix.lower() not in (".parquet", ".csv", ".mcap"):
        raise ConfigError(f"a log is written as .parquet, .csv or .mcap, not as '{path.name}'")
    if path.exists() and not overwrite:
        raise InputError(f"{path} is there already; choose another name or overwrite it explicitly")
    if path.suffix.lower() == ".mcap":
        from auvnn.logs.writing_mcap import write_mcap

        return write_mcap(log, path)
    _placed(to_frame(log), path)
    if path.suffix.lower() == ".csv":
        write_seal(path, file_hash(path))
    return path


def write_commands(log: Log, path: Path) -> Path:
    """Write what the vehicle was told, as a CSV file that a mission script can read: run, t, commands, fin angles.

    Row k is held from its time to that of row k + 1.

    Raises:
        InputError: the file cannot be written.
    """
    frame = to_frame(log)
    told = [n for n in frame.columns if n in ("run", "t") or n.startswith(("thruster_", "tau_", "fin_"))]
    return _placed(frame.select(told), path)


def _placed(frame: pl.DataFrame, path: Path) -> Path:
    refuse_device(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        os.close(handle)
    except OSError as problem:
        raise InputError(f"{path} cannot be written: {problem.strerror}") from problem
    try:
        if path.suffix.lower() == ".csv":
            # Empty cells, not the word NaN: spreadsheets read them as missing too.
            frame.fill_nan(None).write_csv(temporary)
        else:
            # Parquet's own checksums are optional and rarely checked; this one is checked on reading.
            frame.write_parquet(temporary, metadata={HASH_KEY: frame_hash(frame)})
        os.chmod(temporary, 0o644)
        # The seal of what was there goes first: it must never stand beside something else.
        seal_of(path).unlink(missing_ok=True)
        os.replace(temporary, path)
    except OSError as problem:
        raise InputError(
            f"{path} cannot be written: {problem.strerror or one_line(problem, 200)}"
        ) from problem
    except Exception as problem:
        # What polars says about a full disk is no OSError.
        if type(problem).__module__.split(".")[0] != "polars":
            raise
        raise InputError(f"{path} cannot be written: {one_line(problem, 200)}") from problem
    finally:
        Path(temporary).unlink(missing_ok=True)
    return path
