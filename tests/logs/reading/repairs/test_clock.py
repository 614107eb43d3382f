"""Time stamps: dropped, sorted, split or refused, always with a count."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.reading.repairs.clock import order_in_time
from tests.log_samples import frame, make_run

T = 0.1 * np.arange(100)


def notes(t: np.ndarray) -> tuple[list[np.ndarray], dict[str, int]]:
    parts, repairs = order_in_time(t, "here")
    return parts, {r.what: r.count for r in repairs}


def test_good_time_is_left_alone() -> None:
    parts, found = notes(T)
    assert found == {}
    np.testing.assert_array_equal(parts[0], np.arange(100))


def test_missing_stamps_are_dropped() -> None:
    t = T.copy()
    t[[3, 50]] = np.nan
    t[60] = np.inf
    parts, found = notes(t)
    assert len(parts[0]) == 97
    assert found == {"samples without a time stamp dropped": 3}


def test_repeated_stamps_keep_the_first() -> None:
    t = T.copy()
    t[[11, 12]] = t[10]
    parts, found = notes(t)
    assert 10 in parts[0]
    assert 11 not in parts[0]
    assert found == {"samples with a repeated time stamp dropped (the first is kept)": 2}


def test_late_samples_are_sorted() -> None:
    t = T.copy()
    t[[20, 21, 22, 23]] = t[[21, 22, 23, 20]]
    parts, found = notes(t)
    (part,) = parts
    assert (np.diff(t[part]) > 0).all()
    assert len(part) == 100
    assert found == {"samples out of order sorted by time (largest step back 0.3 s)": 1}


def test_a_large_step_back_splits() -> None:
    t = np.concatenate([T, T])
    parts, found = notes(t)
    assert [len(p) for p in parts] == [100, 100]
    assert found == {"time runs backwards (by up to 9.9 s): split into further runs": 1}


@pytest.mark.parametrize("back", [0.5, 0.53, 0.57])
def test_a_clock_set_back_is_no_disorder(back: float) -> None:
    """A clock step shows a time twice: sorting would interleave two stretches that never were one."""
    t = np.concatenate([T[:50], T[50:] - back - 0.1])
    parts, _ = notes(t)
    assert [len(p) for p in parts] == [50, 50]


def test_leading_zeros_before_a_clock_that_counts_from_1970() -> None:
    t = np.concatenate([np.zeros(5), 1.7e9 + T])
    parts, found = notes(t)
    assert len(parts[0]) == 100
    assert found == {"samples with stamp 0 before the clock started dropped": 5}
    assert len(notes(T)[0][0]) == 100  # a run that starts at zero keeps its first sample


@pytest.mark.parametrize(
    ("t", "word"),
    [
        (1e3 * 0.02 * np.arange(50), r"median time step 20 s: is t in ms"),
        (1e6 * 0.02 * np.arange(50), "is t in us"),
        (1e9 * 0.02 * np.arange(50), "is t in ns"),
        (1e-6 * np.arange(50), "must be in seconds"),
        (np.full(50, 3.0), "the same time stamp"),
        (np.array([0.0, 0.1]), "at least 3"),
        (np.full(50, np.nan), "0 samples"),
        ((1.7e9 + 0.1 * np.arange(2000)).astype(np.float32).astype(float), "32 bits"),
    ],
)
def test_times_that_no_log_has(t: np.ndarray, word: str) -> None:
    with pytest.raises(InputError, match=word):
        order_in_time(t, "here")


@given(
    st.lists(
        st.one_of(st.floats(-1e3, 1e3), st.sampled_from([np.nan, np.inf, 0.0, 1.7e9])),
        min_size=1,
        max_size=60,
    )
)
@settings(max_examples=200, deadline=None)
def test_any_stamps_give_order_or_a_reason(stamps: list[float]) -> None:
    t = np.array(stamps)
    try:
        parts, _ = order_in_time(t, "here")
    except InputError:
        return
    rows = np.concatenate(parts)
    assert len(set(rows.tolist())) == len(rows)
    for part in parts:
        assert len(part) >= 3
        assert (np.diff(t[part]) > 0).all()


def test_a_split_run_gets_a_number_of_its_own(tmp_path: Path) -> None:
    table = frame(make_run(100))
    twice = pl.concat([table, table.with_columns(pl.col("u") + 0.01)]).with_columns(
        pl.Series("run", [1] * 200)
    )
    other = frame(make_run(100, phase=1)).with_columns(pl.Series("run", [2] * 100))
    path = tmp_path / "log.csv"
    pl.concat([twice, other]).write_csv(path)
    log = Log.read(path)
    assert [(r.number, r.samples) for r in log.runs] == [(1, 100), (3, 100), (2, 100)]


def test_interleaved_runs_are_taken_apart(tmp_path: Path) -> None:
    a, b = frame(make_run(100)), frame(make_run(100, phase=1))
    both = pl.concat([a.with_columns(pl.lit(1).alias("run")), b.with_columns(pl.lit(2).alias("run"))])
    path = tmp_path / "log.csv"
    both.sort("t").write_csv(path)
    log = Log.read(path)
    np.testing.assert_array_equal(log.runs[0].nu, make_run(100).nu)
    np.testing.assert_array_equal(log.runs[1].nu, make_run(100, phase=1).nu)


def test_run_column_that_is_no_number(tmp_path: Path) -> None:
    table = frame(make_run(100))
    path = tmp_path / "log.parquet"
    table.with_columns(pl.Series("run", np.arange(100))).write_parquet(path)
    with pytest.raises(InputError, match="100 different values"):
        Log.read(path)
    table.with_columns(pl.Series("run", [1.0] * 99 + [None])).write_parquet(path)
    with pytest.raises(InputError, match="1 rows have no run number"):
        Log.read(path)
    table.with_columns(pl.Series("run", [0.5] * 50 + [1.5] * 50)).write_parquet(path)
    assert [r.number for r in Log.read(path).runs] == [1, 2]
