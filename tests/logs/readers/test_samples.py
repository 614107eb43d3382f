"""The field's own sample files read, or are refused with a reason that is right."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.readers.slocum import SlocumReader

_PARENT = Path(__file__).resolve().parents[4]
FOLDER = Path(os.environ.get("AUVNN_DATA", _PARENT / "shared" / "data")) / "formats"
pytestmark = [
    pytest.mark.data,
    pytest.mark.skipif(
        not (FOLDER / "dataflash").is_dir(),
        reason=f"the samples are not in {FOLDER}; set AUVNN_DATA to the folder that holds formats/",
    ),
]


def test_ardusub_dataflash() -> None:
    log = Log.read(FOLDER / "dataflash" / "ardusub_small.BIN")
    run = log.runs[0]
    assert (log.samples, run.thrusters.shape[1]) == (237, 6)
    assert 1 / run.dt == pytest.approx(10.0, abs=0.1) and run.duration == pytest.approx(23.6, abs=0.2)
    assert np.nanmax(np.abs(run.thrusters)) < 0.05  # at rest


def test_dataflash_agrees_with_pymavlink_in_every_number() -> None:
    pytest.importorskip("pymavlink")
    from pymavlink import DFReader

    from auvnn.logs.readers.dataflash import DataFlashReader

    path = FOLDER / "dataflash" / "ardusub_small.BIN"
    recording = DataFlashReader().record(path)
    theirs, rows = DFReader.DFReader_binary(str(path)), {}
    while (message := theirs.recv_msg()) is not None:
        rows.setdefault(message.get_type(), []).append(message.to_dict())
    compared = 0
    for name, topic in recording.topics.items():
        base, _, number = name.partition("[")
        mine = rows[base]
        if number:
            label = next(n for n in ("I", "C", "IMU", "Instance", "Id") if n in topic.columns)
            mine = [r for r in mine if r[label] == topic.columns[label][0]]
        assert len(mine) == len(topic.t), name
        for label, column in topic.columns.items():
            np.testing.assert_allclose(
                column, [float(r[label]) for r in mine], rtol=1e-12, err_msg=f"{name}.{label}"
            )
            compared += len(column)
    assert compared > 50_000


def test_telemetry() -> None:
    pytest.importorskip("pymavlink")
    moved = Log.read(FOLDER / "tlog" / "ardusub_small.tlog")
    assert moved.samples == 792 and moved.n_thrusters == 8
    assert moved.runs[0].duration == pytest.approx(263.0, abs=1.0)
    assert np.nanmax(np.abs(moved.runs[0].thrusters)) == pytest.approx((1723 - 1500) / 400, abs=0.01)
    still = Log.read(FOLDER / "tlog" / "ardusub_2023-04-18.tlog")
    assert still.unmeasured == ["u", "v", "w"]


def test_ulog() -> None:
    pytest.importorskip("pyulog")
    made = Log.read(FOLDER / "ulog" / "synthetic_uuv.ulg")
    assert made.samples == 3000 and made.n_thrusters == 8
    assert Log.read(FOLDER / "ulog" / "sample_log_small.ulg").duration == pytest.approx(6.5, abs=0.2)


def test_imc() -> None:
    log = Log.read(FOLDER / "imc" / "synthetic_Data.lsf.gz")
    assert log.samples == 2000
    np.testing.assert_allclose(log.runs[0].nu[:, 0], 1.2, atol=1e-6)


@pytest.mark.parametrize("name", ["ros1/example.bag", "ros2/talker_mcap"])
def test_bags_of_other_things_are_refused_and_listed(name: str) -> None:
    pytest.importorskip("rosbags")
    with pytest.raises(InputError, match="nothing in it is known to be what a log needs"):
        Log.read(FOLDER / name)


def test_turtles_are_seen() -> None:
    pytest.importorskip("rosbags")
    from auvnn.logs.inspect_file import look

    seen = look(FOLDER / "ros1" / "example.bag")
    pose = seen.recording.topics["/turtle1/pose"]
    assert pose.messages == 1344 and set(pose.columns) >= {"x", "y", "theta", "linear_velocity"}
    assert "commands" in seen.proposal.lacks


@pytest.mark.parametrize("ending", ["dbd", "ebd"])
def test_a_glider_is_read_or_says_what_it_takes(ending: str) -> None:
    path = FOLDER / "slocum" / f"gf_comet-2016-174-05-001.{ending}"
    if importlib.util.find_spec("dbdreader") is not None and ending == "dbd":
        run = Log.read(path).runs[0]
        assert run.samples == 674 and run.ballast is not None and run.position is not None
        # A shallow dive of the Baltic: the pump moves 230 cm3 either way, and down is where the nose points.
        assert np.nanmax(np.abs(run.ballast)) == pytest.approx(231e-6, rel=0.02)
        rate = np.gradient(run.position[:, 2], run.t)
        moving = np.isfinite(rate) & (np.abs(run.euler[:, 1]) > 0.3)
        assert np.corrcoef(rate[moving], -np.sin(run.euler[moving, 1]))[0, 1] > 0.9
        return
    with pytest.raises(InputError, match=r"dbdreader|missing|known"):
        Log.read(path)


def test_a_gliders_sensors_are_those_that_its_library_reads_one_by_one() -> None:
    dbdreader = pytest.importorskip("dbdreader", reason="dbdreader is not installed")
    path = FOLDER / "slocum" / "gf_comet-2016-174-05-001.dbd"
    found = SlocumReader().record(path).topics
    log = dbdreader.DBD(str(path), cacheDir=str(path.parent / "cac"))
    begin = min(log.get(n)[0].min() for n in ("m_depth", "m_pitch", "m_air_pump"))
    for name in ("m_depth", "m_pitch", "m_ballast_pumped", "m_battpos", "m_water_vx"):
        t, values = log.get(name)
        np.testing.assert_array_equal(found[name].columns["value"], values)
        np.testing.assert_allclose(found[name].t - (t - begin), found["m_depth"].t[0], atol=1e-6)
