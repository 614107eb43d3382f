"""Windows found portion by portion are those of the whole log."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from auvnn.errors import InputError
from auvnn.log_chunks import scan as parts_
from auvnn.log_chunks.scan import WindowCut
from auvnn.log_chunks.windows import concatenate_windows, plan_file, runs_of, windows_of
from auvnn.logs import Log, Run
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.metrics.windows import Windows, cut_windows
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def log() -> Log:
    return make_log(GreyBox(small_vehicle()), runs=2, duration=61.3, rate=10.0, noise=1.0, uneven=0.4)


def cut(log: Log, horizon: float = 2.0) -> WindowCut:
    return WindowCut(horizon, 1.5, log.kind, Mapping.read(None))


def gap(log: Log) -> Log:
    """Cut a hole into the first run, and take away a command and an attitude elsewhere."""
    run = log.runs[0]
    keep = (run.t < 17.03) | (run.t > 20.4)
    commands, quaternion = np.array(run.thrusters), np.array(run.quaternion)
    commands[333], quaternion[405:409] = np.nan, np.nan
    holed = dataclasses.replace(run, thrusters=commands, quaternion=quaternion)
    changes = {n: getattr(holed, n)[keep] for n in ("t", "quaternion", "nu", "position", "thrusters")}
    return Log.from_runs([Run(0, **changes), log.runs[1]])


def same(one: Windows, other: Windows) -> None:
    """Compare what was measured in each window; how many rows of history follows from each part's median step."""
    assert len(one) == len(other) and (one.length == other.length).all()
    assert abs(one.warmup - other.warmup) <= 1
    for name in ("times", "eta", "nu", "mask"):
        a, b = getattr(one, name), getattr(other, name)
        if name == "times":
            a, b = a[:, one.warmup :], b[:, other.warmup :]
        for k, n in enumerate(one.length):
            assert torch.allclose(a[k, :n], b[k, :n], rtol=0, atol=1e-12), (name, k)
    back = min(one.warmup, other.warmup)
    a, b = one.inputs.command, other.inputs.command
    assert torch.equal(a[:, one.warmup - back : one.warmup + 2], b[:, other.warmup - back : other.warmup + 2])


@pytest.mark.parametrize("rows", [150, 233, 100_000])
@pytest.mark.parametrize("holes", [False, True])
def test_the_plan_finds_the_windows_of_the_whole_log(log, tmp_path, monkeypatch, rows, holes):
    monkeypatch.setattr(parts_, "ROWS", rows)
    monkeypatch.setattr(parts_, "WINDOWS", 7)
    path = tmp_path / "log.parquet"
    (gap(log) if holes else log).write(path)
    whole = Log.read(path)
    plan = plan_file(cut(whole), path)
    wanted = cut_windows(whole, 2.0, warmup=1.5, kind=whole.kind, partial=True)
    found = [windows_of(p, cut(whole)) for p in plan.parts]
    assert (plan.samples, plan.runs) == (whole.samples, 2)
    assert plan.duration == pytest.approx(whole.duration)
    assert plan.windows == len(wanted)
    at = 0
    for some in found:
        same(some, wanted.pick(slice(at, at + len(some))))
        assert (some.run == wanted.run[at : at + len(some)]).all()
        at += len(some)


def test_csv_files_are_planned_too(log, tmp_path):
    path = tmp_path / "log.csv"
    log.write(path)
    plan = plan_file(cut(log), path)
    wanted = cut_windows(Log.read(path), 2.0, warmup=1.5, kind=log.kind, partial=True)
    assert plan.windows == len(wanted)
    same(windows_of(plan.parts[0], cut(log)), wanted.pick(slice(0, len(plan.parts[0]))))


def test_runs_of_several_files_are_numbered_apart(log, tmp_path):
    paths = [log.write(tmp_path / f"{k}.parquet") for k in range(2)]
    plan = concatenate_windows([plan_file(cut(log), p) for p in paths])
    assert list(dict.fromkeys(p.run for p in plan.parts)) == [0, 1, 2, 3]
    assert plan.runs == 4 and plan.samples == 2 * log.samples


def test_a_sample_is_evenly_spread_and_made_of_neighbours(log, tmp_path, monkeypatch):
    monkeypatch.setattr(parts_, "WINDOWS", 10)
    plan = plan_file(cut(log), log.write(tmp_path / "log.parquet"))
    some = plan.spread(12, together=3)
    assert sum(map(len, some)) == 12 and len({p.run for p in some}) == 2
    assert plan.spread(None) == plan.parts == plan.spread(1000)
    for part in some:
        assert np.allclose(np.diff(part.times[:, 0]), 2.0, atol=0.15)
    stretches = runs_of(some, cut(log))
    assert [r.number for r in stretches] == [1, 2, 3, 4]
    assert [r.duration for r in stretches] == pytest.approx([6.0] * 4, abs=0.15)
    again = cut_windows(Log.from_runs(stretches), 2.0, kind=log.kind, partial=True)
    assert np.allclose(again.times[:, 0].reshape(4, 3), np.stack([p.times[:, 0] for p in some]), atol=0.15)


def test_rows_of_a_run_that_are_apart_are_refused(log, tmp_path):
    import polars as pl

    path = tmp_path / "log.parquet"
    log.write(path)
    frame = pl.read_parquet(path)
    pl.concat([frame, frame.filter(pl.col("run") == 0).with_columns(t=pl.col("t") + 100.0)]).write_parquet(
        path
    )
    with pytest.raises(InputError, match="rows of run 0 are not together"):
        plan_file(cut(log), path)


def test_a_file_that_changes_meanwhile_is_noticed(log, tmp_path):
    path = log.write(tmp_path / "log.parquet")
    part = plan_file(cut(log), path).parts[-1]
    log.select(0).write(path, overwrite=True)
    with pytest.raises(InputError):
        windows_of(part, cut(log))
