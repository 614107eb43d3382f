"""A log that is stamped in seconds since 1970 gives the answers of the same log stamped from its beginning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import auvnn
from auvnn.effects import Extent, effect_class
from auvnn.logs import Log
from auvnn.logs.clock_origin import counted_from, origin_of
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.portions import read_portion
from auvnn.vehicle import load_vehicle

TODAY = 1_763_858_361.0


@pytest.fixture(scope="module")
def together() -> Log:
    """Two runs of which each begins at zero: stamps every 0.05 s."""
    hidden = {"payload": {"time": 9.0, "mass": 6.0, "z": 0.3, "buoyancy": 20.0}}
    return auvnn.simulate(
        auvnn.load("rov95"), "multisine", "realistic", hidden, 3, runs=2, duration=20.0, accelerations=False
    ).log


@pytest.fixture(scope="module")
def made(together: Log) -> Log:
    """Two runs on one clock, the second a minute after the first."""
    first, second = together.runs
    return Log.from_runs([first, replace(second, t=np.round(second.t + 60.0, 6))])


def dated(log: Log) -> pl.DataFrame:
    return log.to_polars().with_columns(pl.col("t") + TODAY)


def test_decimals_come_back_and_no_two_stamps_meet():
    t = np.arange(0.0, 30.0, 0.02)
    since = counted_from(t + TODAY, origin_of(t + TODAY))
    assert np.abs(since - t).max() < 1e-14
    thirds = np.arange(900) / 30.0
    since = counted_from(thirds + TODAY, origin_of(thirds + TODAY))
    assert np.abs(since - thirds).max() < np.spacing(TODAY)
    # As near as two stamps can be, anywhere between two microseconds.
    close = TODAY + np.arange(4000) * np.spacing(TODAY)
    assert (np.diff(counted_from(close, TODAY)) > 0).all()


@pytest.mark.parametrize("first", [0.0, 12.5, 9.9e6])
def test_a_clock_that_shows_no_date_is_left_alone(first: float, made: Log):
    t = made.runs[0].t + first
    assert origin_of(t) == 0.0 and counted_from(t, 0.0) is t
    assert Log.from_runs([replace(made.runs[0], t=t)]).runs[0].t[0] == first


@pytest.mark.parametrize("kind", ["csv", "parquet", "frame", "runs", "netcdf", "matlab"])
def test_it_is_the_same_log_whichever_way_it_comes(kind: str, made: Log, tmp_path: Path):
    frame, path = dated(made), tmp_path / f"log.{kind}"
    if kind == "csv":
        frame.fill_nan(None).write_csv(path)
    elif kind == "parquet":
        frame.write_parquet(path)
    elif kind == "netcdf":
        netCDF4 = pytest.importorskip("netCDF4")
        with netCDF4.Dataset(path, "w") as file:
            file.createDimension("time", frame.height)
            for name in frame.columns:
                file.createVariable(name, "f8", ("time",))[:] = frame[name].to_numpy()
    elif kind == "matlab":
        from scipy.io import savemat

        savemat(path, {name: frame[name].to_numpy() for name in frame.columns})
    if kind == "frame":
        log = Log.from_dataframe(frame)
    elif kind == "runs":
        log = Log.from_runs([replace(r, t=r.t + TODAY) for r in made.runs])
    else:
        log = Log.read(path)
    assert [r.number for r in log.runs] == [r.number for r in made.runs]
    for run, other in zip(log.runs, made.runs, strict=True):
        np.testing.assert_allclose(run.t, other.t, rtol=0, atol=1e-13)
        np.testing.assert_array_equal(run.nu, other.nu)
    told = [r for r in log.repairs if "dates" in r.what]
    assert len(told) == 1 and told[0].level == "info" and f"{TODAY:.0f}" in told[0].what
    # What is left of a log stays on its clock.
    assert log.select(log.runs[1].number).runs[0].t[0] == log.runs[1].t[0] > 59.0


@pytest.mark.parametrize("unit", ["s", "ns"])
def test_parts_of_a_file_are_on_the_clock_of_the_whole(unit: str, made: Log, tmp_path: Path):
    frame = made.to_polars()
    if unit == "ns":
        whole = (frame["t"].to_numpy() * 1e9).round().astype(np.int64) + int(TODAY) * 10**9
        frame = frame.with_columns(pl.Series("t", whole))
    else:
        frame = dated(made)
    mapping = Mapping.read({"time": {"unit": unit}})
    for path in (tmp_path / "log.csv", tmp_path / "log.parquet"):
        frame.write_csv(path) if path.suffix == ".csv" else frame.write_parquet(path)
        run = Log.read(path, mapping).runs[0]
        for first in (0, 100):
            portion = read_portion(path, mapping, first, 200)
            np.testing.assert_array_equal(portion.runs[0].t, run.t[first : first + 200])
            np.testing.assert_array_equal(portion.t, run.t[first : first + 200])


def test_a_load_is_looked_for_in_the_dives_and_not_between_them():
    payload = effect_class("payload")
    described = payload.describe(load_vehicle("rov95"), "thrusters")
    dives = ((0.0, 60.0), (86_400.0, 86_460.0))
    times = [s["time"] for s in payload.starts(described, Extent(0.0, 86_460.0, 60.0, runs=dives))]
    assert times == [7.5, 22.5, 37.5, 52.5, 86_407.5, 86_422.5, 86_437.5, 86_452.5]
    nearer = payload.closest(described, Extent(0.0, 86_460.0, 60.0, runs=dives), {"time": 52.5}, 0)
    assert all(any(a <= s["time"] <= b for a, b in dives) for s in nearer) and len(nearer) > 8
    # Runs on one clock that begin together are one stretch.
    together = payload.starts(described, Extent(0.0, 60.0, 60.0, runs=((0.0, 60.0), (0.0, 60.0))))
    assert together == payload.starts(described, Extent(0.0, 60.0, 60.0))


def _same(one: Any, other: Any, where: str = "") -> None:
    """Compare two answers number by number, names of logs and hashes aside."""
    if isinstance(one, dict):
        assert one.keys() == other.keys(), where
        for key in one.keys() - {"log", "test", "sha256", "read", "seconds", "how", "held_out"}:
            _same(one[key], other[key], f"{where}.{key}")
    elif isinstance(one, (list, tuple)):
        assert len(one) == len(other), where
        for k, (a, b) in enumerate(zip(one, other, strict=True)):
            _same(a, b, f"{where}[{k}]")
    elif isinstance(one, float):
        assert other == pytest.approx(one, rel=1e-6, abs=1e-9), where
    else:
        assert one == other, where


def test_compare_gives_the_same(made: Log):
    shifted = Log.from_dataframe(dated(made))
    model = auvnn.load("rov95")
    _same(auvnn.compare(model, made).to_dict(), auvnn.compare(model, shifted).to_dict())


@pytest.mark.long
def test_check_diagnose_and_add_give_the_same(together: Log):
    shifted = Log.from_dataframe(dated(together))
    model, asked = auvnn.load("rov95"), ["payload", "net_buoyancy", "flooding"]
    logs = (together, shifted)
    one, other = ([f for f in log.quality().findings if "dates" not in f.what] for log in logs)
    assert [str(f) for f in one] == [str(f) for f in other]
    answers = [auvnn.diagnose(model, log, asked, advice=False, whiteness=False).to_dict() for log in logs]
    assert answers[0]["missing"] == ["payload"]
    _same(answers[0], answers[1])
    added = [auvnn.add(model, log, ["payload"]).to_dict() for log in logs]
    assert added[0]["accepted"]
    _same(added[0], added[1])
