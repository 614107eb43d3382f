"""Parquet: exact round trips, and damage that is seen."""

import datetime
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from tests.log_samples import frame, make_log, make_run, same


def rich_log() -> Log:
    """A log with every block, missing samples, odd numbers and a column of the user's own."""
    rng = np.random.default_rng(0)
    runs = []
    for number in (3, 7):
        base = make_run(200, number=number, noise=0.01, seed=number)
        nu = base.nu.copy()
        nu[5, 2], nu[9] = np.nan, np.nan
        quaternion = base.quaternion.copy()
        quaternion[20] = np.nan
        runs.append(
            make_run(
                200,
                number=number,
                t=np.cumsum(rng.uniform(0.04, 0.06, 200)),
                nu=nu,
                quaternion=quaternion,
                nu_dot=rng.normal(size=(200, 6)) * 1e-300,
                wrench=rng.normal(size=(200, 6)) * 1e7,
                fins=rng.normal(size=(200, 2)),
                altitude=np.abs(rng.normal(size=200)),
                extra={"my column / °C": rng.normal(size=200)},
            )
        )
    return Log.from_runs(runs, name="rich")


@pytest.mark.parametrize(("name", "tolerance"), [("log.parquet", 0.0), ("log.csv", 1e-15)])
def test_write_and_read_round_trip(name: str, tolerance: float, tmp_path: Path) -> None:
    log = rich_log()
    path = log.write(tmp_path / "deeper" / name)
    back = Log.read(path)
    assert [r.number for r in back.runs] == [3, 7]
    for a, b in zip(log.runs, back.runs, strict=True):
        same(a, b, tolerance)
    assert {r.level for r in back.repairs} <= {"info"}
    assert back.columns == log.columns


def test_round_trip_of_a_round_trip_is_the_same_file(tmp_path: Path) -> None:
    first = rich_log().write(tmp_path / "a.parquet")
    second = Log.read(first).write(tmp_path / "b.parquet")
    assert first.read_bytes() == second.read_bytes()
    assert Log.read(first).sha256 == Log.read(second).sha256


def test_nothing_is_overwritten_by_accident(tmp_path: Path) -> None:
    log = make_log(1)
    path = log.write(tmp_path / "log.csv")
    before = path.read_bytes()
    with pytest.raises(InputError, match="is there already"):
        make_log(2).write(path)
    assert path.read_bytes() == before
    make_log(2).write(path, overwrite=True)
    assert path.read_bytes() != before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["log.csv", "log.csv.sha256"]
    assert Log.read(path).samples > 0, "the seal is that of the new file"
    with pytest.raises(ConfigError, match=r"\.parquet, \.csv or \.mcap"):
        log.write(tmp_path / "log.mat")


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        make_log(1).write(tmp_path / "file" / "log.csv")


def test_truncated_and_garbled_files(tmp_path: Path) -> None:
    path = make_log(1).write(tmp_path / "log.parquet")
    whole = path.read_bytes()
    bad = tmp_path / "bad.parquet"
    for size in (4, 100, len(whole) // 2, len(whole) - 1):
        bad.write_bytes(whole[:size])
        with pytest.raises(InputError, match="cut short"):
            Log.read(bad)
    bad.write_bytes(whole[:-200] + b"\xff" * 150 + whole[-50:])
    with pytest.raises(InputError, match="damaged"):
        Log.read(bad)


def test_a_flipped_bit_in_our_own_file_is_seen(tmp_path: Path) -> None:
    log = make_log(1)
    path = log.write(tmp_path / "log.parquet")
    whole = bytearray(path.read_bytes())
    rng = np.random.default_rng(0)
    bad = tmp_path / "bad.parquet"
    silent = 0
    for _ in range(60):
        damaged = bytearray(whole)
        damaged[rng.integers(4, len(whole) - 8)] ^= 1 << rng.integers(0, 8)
        bad.write_bytes(damaged)
        try:
            back = Log.read(bad)
        except InputError:
            continue
        try:
            same(log.runs[0], back.runs[0])
        except AssertionError:
            silent += 1
    assert silent == 0


def test_no_rows_and_no_numbers(tmp_path: Path) -> None:
    path = tmp_path / "log.parquet"
    frame(make_run(60)).head(0).write_parquet(path)
    with pytest.raises(InputError, match="no rows"):
        Log.read(path)
    frame(make_run(60)).with_columns(pl.Series("u", [[1.0]] * 60)).write_parquet(path)
    with pytest.raises(InputError, match="'u' is no column of numbers: it holds lists or records"):
        Log.read(path)


def test_types_other_than_float64(tmp_path: Path) -> None:
    run = make_run(60)
    start = datetime.datetime(2026, 3, 4, 5, 6, 7)
    table = frame(run).with_columns(
        pl.Series("t", [start + datetime.timedelta(milliseconds=50 * i) for i in range(60)]),
        pl.col("u").cast(pl.Float32),
        pl.Series("flag", [True, False] * 30),
        pl.Series("voltage", np.arange(60)),
        pl.Series("altitude", ["1.5"] * 60),
    )
    path = tmp_path / "log.parquet"
    table.write_parquet(path)
    back = Log.read(path).runs[0]
    np.testing.assert_allclose(back.t, 0.05 * np.arange(60), atol=1e-9)
    np.testing.assert_allclose(back.nu[:, 0], run.nu[:, 0], rtol=1e-6)
    np.testing.assert_array_equal(back.extra["flag"], [1.0, 0.0] * 30)
    np.testing.assert_array_equal(back.voltage, np.arange(60.0))
    np.testing.assert_array_equal(back.altitude, np.full(60, 1.5))


def test_infinite_values_are_missing(tmp_path: Path) -> None:
    nu = make_run(60).nu.copy()
    nu[3, 0], nu[4, 0] = np.inf, -np.inf
    path = tmp_path / "log.parquet"
    frame(make_run(60, nu=nu)).write_parquet(path)
    log = Log.read(path)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(log.runs[0].nu[:, 0])), [3, 4])


def test_a_footer_that_promises_too_much_memory_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = make_log(1).write(tmp_path / "log.parquet")
    monkeypatch.setattr("auvnn.logs.readers.memory.available_bytes", lambda: 1000)
    with pytest.raises(InputError, match="GB of memory"):
        Log.read(path)
    path = make_log(1).write(tmp_path / "log.csv")
    with pytest.raises(InputError, match="GB of memory"):
        Log.read(path)


def test_a_file_that_changes_while_it_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from auvnn.logs.readers.csv import CsvReader

    path = make_log(1).write(tmp_path / "log.csv")
    original = CsvReader.read

    def read_and_append(self: CsvReader, file: Path) -> object:
        table = original(self, file)
        with file.open("a") as stream:
            stream.write("1\n")
        return table

    monkeypatch.setattr(CsvReader, "read", read_and_append)
    with pytest.raises(InputError, match="changed while it was read"):
        Log.read(path)

    def read_and_delete(self: CsvReader, file: Path) -> object:
        table = original(self, file)
        file.unlink()
        return table

    monkeypatch.setattr(CsvReader, "read", read_and_delete)
    with pytest.raises(InputError, match="disappeared"):
        Log.read(path)
