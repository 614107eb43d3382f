"""Rows 9, 10, 16, 17, 31 and 39: recordings that are damaged or packed, and stamps that are no seconds."""

from __future__ import annotations

import io
import tarfile
import zipfile
import zlib
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.errors import AuvnnError, InputError
from auvnn.logs import Log
from auvnn.logs.readers.unpack import unpack
from tests.log_samples import frame, make_run

FMT = bytes([0xA3, 0x95, 128])


def described(number: int, name: bytes, form: bytes, columns: bytes, size: int) -> bytes:
    """One description of a DataFlash message, as ArduPilot writes it (89 bytes)."""
    return (
        FMT + bytes([number, size]) + name.ljust(4, b"\0") + form.ljust(16, b"\0") + columns.ljust(64, b"\0")
    )


@pytest.mark.parametrize("kind", ["beginning", "unknown", "twice"])
def test_row_9_and_10_dataflash_that_does_not_describe_itself(kind):
    attitude = b"".join(
        bytes([0xA3, 0x95, 30]) + np.array([k * 100_000], "<u8").tobytes() + np.zeros(3, "<f4").tobytes()
        for k in range(100)
    )
    known = described(30, b"ATT", b"Qfff", b"TimeUS,Roll,Pitch,Yaw", 23)
    text = {
        "beginning": attitude,
        "unknown": described(30, b"ATT", b"Q?ff", b"TimeUS,Roll,Pitch,Yaw", 23) + attitude,
        "twice": known + described(30, b"ATT", b"QffQ", b"TimeUS,A,B,C", 27) + attitude,
    }[kind]
    Path("log.bin").write_bytes(text)
    with pytest.raises(AuvnnError) as caught:
        Log.read("log.bin")
    assert "\n" not in str(caught.value) and "log.bin" in str(caught.value)


def test_row_9_a_dataflash_log_without_its_beginning():
    test_row_9_and_10_dataflash_that_does_not_describe_itself("beginning")
    assert Path("log.bin").exists()


def test_row_10_a_dataflash_format_that_is_unknown():
    test_row_9_and_10_dataflash_that_does_not_describe_itself("unknown")
    assert Path("log.bin").exists()


@pytest.mark.parametrize("size", [-1, 1000])
def test_row_16_a_block_that_unpacks_to_gigabytes(size):
    bomb = zlib.compress(bytes(50_000_000), 9)
    assert len(bomb) < 100_000
    with pytest.raises(InputError, match=r"size|damaged"):
        unpack("zlib", bomb, size, "log", limit=1_000_000)


@pytest.mark.parametrize("kind", ["zip", "tar", "gz"])
def test_row_17_an_archive_is_refused_and_nothing_is_unpacked(refused, kind):
    path = Path(f"dive.{kind}")
    if kind == "zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("../escaped.csv", "t,u\n0,1\n")
    else:
        with tarfile.open(path, "w:gz" if kind == "gz" else "w") as archive:
            member = tarfile.TarInfo("../escaped.csv")
            member.size = 8
            archive.addfile(member, io.BytesIO(b"t,u\n0,1\n"))
    before = sorted(p.name for p in Path.cwd().iterdir())
    assert "dive" in refused("check", f"log={path}")
    assert sorted(p.name for p in Path.cwd().iterdir()) == before and not Path("../escaped.csv").exists()


def test_row_31_a_counter_of_microseconds_that_wraps(noted):
    table = frame(make_run(400, noise=0.01))
    micro = (4_294_967_296 - 10_000_000 + (table["t"] * 1e6).round().cast(pl.Int64)) % 4_294_967_296
    table.with_columns(t=micro).write_csv("log.csv")
    assert "time runs backwards" in noted("log.csv", {"time": {"unit": "us"}})
    runs = Log.read("log.csv", {"time": {"unit": "us"}}).runs
    assert len(runs) == 2 and all((np.diff(run.t) > 0).all() for run in runs)


def test_row_39_dates_as_text_are_refused_with_their_column(refused):
    table = frame(make_run(400))
    stamps = [f"2024-05-01T10:00:{t:09.6f}+02:00" for t in table["t"]]
    table.with_columns(t=pl.Series(stamps)).write_csv("log.csv")
    line = refused("check", "log=log.csv")
    assert "t" in line and "2024" in line
