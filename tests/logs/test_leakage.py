"""A test that was part of the training is found, whatever it is called; a fair one passes."""

from pathlib import Path

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log, leakage
from tests.log_samples import make_log, make_run


def test_different_dives_pass() -> None:
    log = make_log(3)
    train, test, _ = log.split()
    leakage(train, test)
    train, test, _ = make_log(1).split()
    leakage(train, test)
    leakage(make_log(1, noise=0.01), Log.from_runs([make_run(noise=0.01, seed=99)]))


def test_the_same_dive_is_refused_under_any_name(tmp_path: Path) -> None:
    log = make_log(2)
    csv, parquet = log.write(tmp_path / "a.csv"), log.write(tmp_path / "b.parquet")
    with pytest.raises(InputError, match="shares 1600 of 1600 samples"):
        leakage(Log.read(csv), Log.read(parquet))
    moved = make_run(t=make_run().t + 1000.0, quaternion=-make_run().quaternion, number=9)
    with pytest.raises(InputError, match="a memory, not a prediction"):
        leakage(log, Log.from_runs([moved]))


def test_overlapping_windows_are_refused() -> None:
    run = make_run(1000)
    with pytest.raises(InputError, match="shares 100 of 400"):
        leakage(Log.from_runs([run.cut(slice(0, 700))]), Log.from_runs([run.cut(slice(600, 1000))]))


def test_rest_is_no_overlap() -> None:
    at_rest = {"nu": np.zeros((800, 6)), "quaternion": np.tile([1.0, 0, 0, 0], (800, 1))}
    leakage(Log.from_runs([make_run(**at_rest)]), Log.from_runs([make_run(**at_rest)]))
