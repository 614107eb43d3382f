"""Logs are checked whole: by the hash in an own Parquet file, also where it is read in parts, and by a seal beside."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.readers import file_bytes, frame
from auvnn.logs.readers.csv import CsvReader
from auvnn.logs.readers.parquet import ParquetReader
from auvnn.logs.reading import portions
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.seal import compare, file_hash, seal_of, write_seal
from tests.command_line import auvnn, refused
from tests.log_samples import frame as table
from tests.log_samples import make_log, make_run


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def flipped(path: Path, place: int, bit: int = 0) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 1 << bit
    path.write_bytes(data)


def test_a_flipped_bit_is_seen_when_an_own_parquet_log_is_read_in_parts():
    path = make_log(2).write(Path("log.parquet"))
    whole, good = path.read_bytes(), Log.read("log.parquet")
    rng = np.random.default_rng(0)
    refused = changed = 0
    for place in rng.integers(4, len(whole) - 8, 60):
        flipped(path, int(place), int(rng.integers(8)))
        try:
            portions.verify(path)
            found = portions.read_portion(path, Mapping.read(None), 0, good.samples)
            changed += not np.array_equal(found.runs[0].nu, good.runs[0].nu, equal_nan=True)
        except InputError:
            refused += 1
        path.write_bytes(whole)
    assert changed == 0 and refused > 40


def test_verifying_takes_the_columns_one_by_one_and_gives_the_same_hash(monkeypatch):
    monkeypatch.setattr("auvnn.logs.readers.parquet._AT_ONCE", 37)
    path = make_log(2).write(Path("log.parquet"))
    ParquetReader().verify(path)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_sealed_log_that_changed_is_refused_by_every_way_of_reading(kind):
    path = Path(f"theirs.{kind}")
    data = table(make_run(400))
    data.write_csv(path) if kind == "csv" else data.write_parquet(path)
    assert Log.read(path).unsealed == (path,)
    write_seal(path, file_hash(path))
    assert Log.read(path).unsealed == ()
    portions.verify(path)
    if kind == "csv":
        path.write_text(path.read_text().replace("0.1", "0.2", 1))
    else:
        flipped(path, 60)
    for read in (Log.read, portions.verify):
        with pytest.raises(InputError, match=r"differs from its seal|damaged"):
            read(path)
    if kind == "csv":
        os.remove(seal_of(path))
        assert Log.read(path).unsealed == (path,), "damage of this kind cannot be known without a seal"


def test_the_seal_is_what_sha256sum_reads():
    path = make_log(1).write(Path("my log.csv"))
    assert seal_of(path).read_text() == f"{hashlib.sha256(path.read_bytes()).hexdigest()}  my log.csv\n"
    assert compare(path, file_hash(path)) and Log.read(path).unsealed == ()


def test_a_seal_that_is_none_is_refused():
    path = make_log(1).write(Path("log.csv"))
    seal_of(path).write_text("soon\n")
    with pytest.raises(InputError, match="holds no checksum"):
        Log.read(path)


def test_check_says_once_what_cannot_be_known_and_seals(auvnn, refused):
    table(make_run(400)).write_csv("a.csv")
    table(make_run(400, seed=1)).write_csv("b.csv")
    status, out, _ = auvnn("check", "log=[a.csv,b.csv]", "out=first")
    assert status == 0 and out.count("no checksum in or next to a.csv, b.csv") == 1
    assert auvnn("check", "log=[a.csv,b.csv]", "seal=true", "out=second")[0] == 0
    status, out, _ = auvnn("check", "log=[a.csv,b.csv]", "out=third")
    assert status == 0 and "checksum" not in out
    Path("b.csv").write_text(Path("b.csv").read_text().replace(".1", ".2", 1))
    assert "b.csv: differs from its seal" in refused("compare", "model=rov95", "log=[a.csv,b.csv]")


__all__ = ["auvnn", "refused"]
NAMES = ["dive[1]", "dive*", "dive?", "{a,b}", "~", "a:b", "%41", "s3:x", "dive\udce4\udcff"]


@pytest.mark.parametrize("kind", ["csv", "parquet"])
@pytest.mark.parametrize("name", NAMES)
def test_a_path_is_taken_literally(name, kind):
    others = ("dive1", "divex", "a", "b", "A", "dive")
    for i, other in enumerate(others):
        make_log(1, noise=0.001 * (i + 1)).write(Path(f"{other}.{kind}"))
    path = Path(f"{name}.{kind}")
    data = table(make_run(400, seed=99, noise=0.01))
    with path.open("wb") as stream:
        data.write_csv(stream) if kind == "csv" else data.write_parquet(stream)
    found = Log.read(path)
    assert np.allclose(found.runs[0].nu[:, 0], data["u"].to_numpy())
    part = portions.read_portion(path, Mapping.read(None), 0, 100)
    assert np.allclose(part.runs[0].nu[:100, 0], data["u"].to_numpy()[:100])
    (Path("fo[l]der") / "in[1]").mkdir(parents=True)
    inner = Path("fo[l]der") / "in[1]" / path.name
    path.rename(inner)
    assert portions.log_files([inner.parent]) == [inner]
    assert portions.log_files([inner.parent / f"*.{kind}"]) == [inner]


def test_a_name_that_is_not_utf_8_goes_through_the_command(auvnn):
    make_log(1).write(Path("good.csv"))
    os.rename("good.csv", b"d\xe4tei.csv")
    os.remove("good.csv.sha256")
    status, _, err = auvnn("check", "log=d\udce4tei.csv", "out=checked")
    assert status == 0, err
    assert Path("checked/report.html").exists()


def test_a_file_that_is_cut_short_while_it_is_read_is_one_line(monkeypatch):
    path = make_log(2).write(Path("log.parquet"))
    words = """
import os, sys, pathlib
from auvnn.logs.readers import parquet, file_bytes
from auvnn.logs.reading import portions
from auvnn.errors import InputError
path = pathlib.Path("log.parquet")
cut = lambda: os.truncate(path, 100)
if sys.argv[1] == "whole":
    read = pathlib.Path.read_bytes
    def then(self):
        data = read(self); cut(); return data
    pathlib.Path.read_bytes = then
    parquet.ParquetReader().read(path)
elif sys.argv[1] == "excerpt":
    parquet._contents(path); cut()
    parquet.ParquetReader().read_rows(path, 0, 10)
else:
    import polars as pl
    scan = pl.scan_parquet
    def then(*a, **k):
        cut(); return scan(*a, **k)
    parquet.pl.scan_parquet = then
    parquet.ParquetReader().read_rows(path, 0, 10)
"""
    whole = path.read_bytes()
    for when, good in (("whole", True), ("excerpt", False), ("decoding", hasattr(os, "memfd_create"))):
        path.write_bytes(whole)
        done = subprocess.run(
            [sys.executable, "-c", words, when], capture_output=True, text=True, timeout=120
        )
        assert done.returncode == (0 if good else 1), (when, done.returncode, done.stderr[-300:])
        assert good or "InputError" in done.stderr


def test_a_file_that_becomes_shorter_is_an_error(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(bytes(range(256)) * 1000)
    with path.open("rb") as stream:
        data = file_bytes.FileBytes(stream, "a")
        assert data[5:9] == bytes([5, 6, 7, 8]) and len(data) == 256_000
        os.truncate(path, 10)
        with pytest.raises(InputError, match="became shorter"):
            data[200_000:200_010]


def test_the_beginning_of_a_sparse_file_of_fifty_gigabytes_is_read_alone(monkeypatch):
    text = table(make_run(400)).write_csv()
    path = Path("long.csv")
    line = text.split("\n")[-2]
    t0, rest = float(line.split(",")[text.split(",").index("t")]), line
    assert t0 > 10 and rest
    path.write_text(text)
    monkeypatch.setattr("auvnn.logs.reading.head._FIRST", len(text) - 50)
    os.truncate(path, 50_000_000_000)
    begin = time.perf_counter()
    log = Log.read(path, max_duration=10.0)
    assert time.perf_counter() - begin < 5.0
    assert log.duration == pytest.approx(10.0, abs=0.1)
    os.remove(path)


def test_what_identifies_the_beginning_of_a_log_is_the_beginning():
    text = table(make_run(400)).write_csv()
    Path("a.csv").write_text(text)
    first = Log.read("a.csv", max_duration=5.0).sha256
    assert first == hashlib.sha256(text.encode()).hexdigest(), "a small file is read whole"


def test_ten_million_equal_names_end_at_once():
    begin = time.perf_counter()
    with pytest.raises(InputError, match="at most"):
        frame.clean_names(["u"] * 10_000_000, "log.csv")
    with pytest.raises(InputError, match="occur twice"):
        frame.clean_names(["u"] * 15_000, "log.csv")
    Path("wide.csv").write_bytes(b"u," * 2_000_000 + b"u\n" + b"1," * 2_000_000 + b"1\n")
    with pytest.raises(InputError, match="at most"):
        CsvReader().read(Path("wide.csv"))
    assert time.perf_counter() - begin < 10.0
