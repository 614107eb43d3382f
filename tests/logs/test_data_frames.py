"""Tables in memory are logs and logs are tables, in whatever library."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from tests.log_samples import frame, make_log, make_run, same

LOG = make_log(2, n=120)


def agrees(back: Log) -> None:
    assert [r.number for r in back.runs] == [r.number for r in LOG.runs]
    for a, b in zip(LOG.runs, back.runs, strict=True):
        same(a, b)


def test_polars_there_and_back() -> None:
    table = LOG.to_polars()
    assert table.columns == LOG.columns
    agrees(Log.from_dataframe(table))
    agrees(Log.from_dataframe(table.lazy()))


def test_pandas_there_and_back() -> None:
    pytest.importorskip("pandas")
    table = LOG.to_pandas()
    assert list(table.columns) == LOG.columns
    agrees(Log.from_dataframe(table))
    agrees(Log.from_dataframe(table.convert_dtypes()))


def test_a_dict_of_arrays() -> None:
    table = LOG.to_polars()
    agrees(Log.from_dataframe({n: table[n].to_numpy() for n in table.columns}))


def test_times_in_the_index_of_pandas() -> None:
    pd = pytest.importorskip("pandas")
    table = make_log(1, n=120).to_pandas().drop(columns="run")
    stamps = pd.to_datetime("2026-01-01") + pd.to_timedelta(table["t"], unit="s")
    for index in (
        stamps,
        stamps.dt.tz_localize("Europe/Oslo"),
        pd.to_timedelta(table["t"], unit="s"),
        table["t"],
    ):
        changed = table.drop(columns="t").set_index(pd.Index(index, name=None))
        back = Log.from_dataframe(changed).runs[0]
        np.testing.assert_allclose(back.t - back.t[0], LOG.runs[0].t, atol=1e-6)


def test_a_mapping_holds_for_data_frames_too() -> None:
    table = frame(LOG.runs[0]).rename({"u": "surge"}).with_columns(pl.col("surge") * 100)
    back = Log.from_dataframe(table, {"columns": {"u": {"from": "surge", "unit": "cm/s"}}})
    np.testing.assert_allclose(back.runs[0].nu, LOG.runs[0].nu, atol=1e-12)
    with pytest.raises(ConfigError, match="no key called"):
        Log.from_dataframe(table, {"colums": {}})


def test_the_same_content_has_the_same_hash() -> None:
    assert Log.from_dataframe(LOG.to_polars()).sha256 == Log.from_dataframe(LOG.to_pandas()).sha256


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ([1, 2, 3], "not of a list"),
        ({"t": np.zeros((3, 2))}, r"'t' has shape \(3, 2\)"),
        ({"t": np.zeros(3), "u": np.zeros(4)}, "'t' has 3 rows and 'u' 4"),
        (pl.DataFrame({"t": []}), "has no rows"),
        ({"t": np.zeros(3, complex)}, "holds complex128"),
        ({"a": np.arange(5.0)}, "column.* missing"),
    ],
)
def test_what_is_no_log(data: object, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        Log.from_dataframe(data)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["log.mcap", "log.parquet", "log.csv"])
def test_written_files_read_back(name: str, tmp_path: Path) -> None:
    if name.endswith("mcap"):
        pytest.importorskip("rosbags")
    path = LOG.write(tmp_path / name)
    back = Log.read(path)
    assert [r.number for r in back.runs] == [1, 2] and back.columns == LOG.columns
    for a, b in zip(LOG.runs, back.runs, strict=True):
        for (left, x), (right, y) in zip(a.columns(), b.columns(), strict=True):
            assert left == right
            np.testing.assert_allclose(
                y - y[0] if left == "t" else y, x - x[0] if left == "t" else x, atol=1e-9
            )
    with pytest.raises(InputError, match="is there already"):
        LOG.write(path)
    assert list(tmp_path.iterdir()) == [path]


def test_an_independent_reader_understands_the_mcap_that_is_written(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    pytest.importorskip("rosbags")
    from mcap_ros2.reader import read_ros2_messages

    run = make_run(50)
    path = Log.from_runs([run]).write(tmp_path / "log.mcap")
    messages = [m.ros_msg for m in read_ros2_messages(str(path), topics=["/auvnn/odometry"])]
    assert len(messages) == 50
    # FLU from FRD, ENU from NED.
    assert messages[7].twist.twist.linear.y == -run.nu[7, 1]
    assert messages[7].pose.pose.position.x == run.position[7, 1]
    assert messages[7].pose.pose.position.z == -run.position[7, 2]
    joints = [m.ros_msg for m in read_ros2_messages(str(path), topics=["/auvnn/log"])]
    assert joints[3].position[list(joints[3].name).index("thruster_2")] == run.thrusters[3, 1]
