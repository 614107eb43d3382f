"""Pipes, full disks, rows written twice or shuffled, and logs that `check` calls an error."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from tests.command_line import auvnn, refused
from tests.log_samples import frame, make_log, make_run

__all__ = ["auvnn", "refused"]


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", ["log.csv", "log.parquet"])
def test_a_pipe_is_refused_and_not_waited_for(refused, name):
    os.mkfifo(name)
    assert "is a pipe or a device" in refused("check", f"log={name}")
    assert "is a pipe or a device" in refused("compare", "log=" + os.devnull, "model=rov95")


@pytest.mark.parametrize("at", [150, 399])
def test_a_block_of_rows_written_twice_is_left_out_once(at):
    table = frame(make_run(400, noise=0.01))
    pl.concat([table[:at], table[50:140], table[at:]]).write_csv("log.csv")
    log = Log.read("log.csv")
    assert sum(r.count for r in log.repairs if "are earlier ones again" in r.what) == 90
    assert len(log.runs) == 1, "the block is no run of its own"
    assert np.array_equal(log.runs[0].nu, make_run(400, noise=0.01).nu)


def test_a_recording_that_runs_through_the_same_times_with_other_values_is_a_run_of_its_own():
    pl.concat([frame(make_run(400, seed=1, noise=0.01)), frame(make_run(400, seed=2, noise=0.01))]).write_csv(
        "log.csv"
    )
    assert len(Log.read("log.csv").runs) == 2


def test_shuffled_rows_are_told_as_such():
    table = frame(make_run(400))
    table[np.random.default_rng(0).permutation(400)].write_csv("log.csv")
    with pytest.raises(InputError, match=r"not in the order of time.*sort the file by t"):
        Log.read("log.csv")


@pytest.mark.parametrize("verb", ["train", "diagnose", "add"])
def test_verbs_refuse_what_check_calls_an_error(auvnn, refused, verb):
    make_log(2, n=400, thrusters=np.zeros((400, 8)), noise=0.01).write(Path("log.parquet"))
    status, out, _ = auvnn("check", "log=log.parquet", "out=checked")
    assert status == 0 and "error" in out and "neutral throughout" in out
    more = ["effect=net_buoyancy"] if verb == "add" else []
    line = refused(verb, "model=rov95", "log=log.parquet", "out=made", *more)
    assert "neutral" in line and "force=true" in line


def test_a_full_disk_while_a_log_is_written_is_one_line_and_leaves_nothing():
    words = """
import resource, signal, sys
from auvnn.cli.main import main
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
import auvnn.logs.writing
place = auvnn.logs.writing._placed
def limited(*a):
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, resource.RLIM_INFINITY))
    try:
        return place(*a)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
auvnn.logs.writing._placed = limited
sys.exit(main(["simulate", "model=rov95", "runs=1", "duration=20", "out=made"]))
"""
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, timeout=200)
    assert done.returncode == 2, done.stderr
    # On a machine that others use it is slow enough to tell of its progress.
    said = [line for line in done.stderr.splitlines() if not line.startswith("progress")]
    assert len(said) == 1 and "cannot be written" in said[0]
    assert not Path("made").exists()
