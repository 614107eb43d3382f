"""What other libraries write in the field's formats comes back as it was, without a mapping."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log
from auvnn.logs.inspect_file import look
from auvnn.logs.readers import choose
from tests.log_samples import make_run
from tests.logs import foreign_formats as foreign

NEEDS = {"mcap": "mcap_ros2", "db3": "rosbags", "bag": "rosbags", "ulog": "pyulog", "tlog": "pymavlink", "imc": "imcpy",
         "matlab-7.3": "h5py", "netcdf": "netCDF4"}  # fmt: skip
RUN = make_run(200)
LOG = Log.from_runs([RUN])
TURN = ("qw", "qx", "qy", "qz")


def written(name: str, folder: Path) -> Path:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    file, writer, _ = foreign.FORMATS[name]
    return writer(LOG, folder / file)


def differences(back: Log) -> dict[str, float]:
    """Largest difference of each channel of the first run; quaternions may have turned their sign."""
    run = back.runs[0]
    sign = np.sign((run.quaternion[0] * RUN.quaternion[0]).sum())
    found = {}
    for name, column in RUN.channels.items():
        if name in run.channels:
            mine = run.channels[name] * (sign if name in TURN else 1.0)
            found[name] = float(np.abs(mine - column).max())
    return found


@pytest.mark.parametrize("name", foreign.FORMATS)
def test_a_log_comes_back(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    tolerance = foreign.FORMATS[name][2]
    back = Log.read(path)
    assert len(back.runs) == 1 and back.samples == RUN.samples
    found = differences(back)
    assert set(RUN.channels) - set(found) <= {"voltage"}
    assert {n: d for n, d in found.items() if d > max(tolerance, 1e-6 if n == "t" else 0.0)} == {}


@pytest.mark.parametrize("name", foreign.FORMATS)
def test_content_is_recognised_under_another_name(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    other = path.rename(path.with_name("unnamed.dat"))
    assert differences(Log.read(other))
    assert choose(other)[0].name == choose(other.rename(path))[0].name


@pytest.mark.parametrize("name", foreign.FORMATS)
def test_half_a_file_is_read_or_refused_and_says_so(name: str, tmp_path: Path) -> None:
    path = written(name, tmp_path)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    try:
        half = Log.read(path)
    except InputError as problem:
        assert str(path) in str(problem)
        return
    assert half.samples < RUN.samples
    clean = name in ("ulog",)  # a ULog may end anywhere
    # Where it is cut between two messages nothing is wrong but its length.
    told = [r for r in half.repairs if r.level == "warning"]
    assert told or clean or half.samples >= RUN.samples // 2 - 5


def test_a_moos_log_of_a_torpedo(tmp_path: Path) -> None:
    back = Log.read(foreign.alog(LOG, tmp_path / "log.alog")).runs[0]
    np.testing.assert_allclose(back.euler, RUN.euler, atol=1e-9)
    np.testing.assert_allclose(back.position, RUN.position, atol=1e-9)
    np.testing.assert_allclose(back.nu[:, 0], RUN.nu[:, 0], atol=1e-12)
    assert np.isnan(back.nu[:, 1:]).all()
    np.testing.assert_allclose(back.thrusters[:, 0], RUN.thrusters[:, 0], atol=1e-12)


@pytest.mark.parametrize("compression", ["BZ2", "LZ4"])
def test_compressed_bags(compression: str, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    back = Log.read(foreign.bag(LOG, tmp_path / "log.bag", compression))
    assert max(differences(back).values()) < 1e-9


def test_a_ros2_bag_is_a_folder_and_names_what_is_missing(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    path = foreign.db3(LOG, tmp_path / "bag")
    assert Log.read(path.parent).samples == RUN.samples
    path.rename(path.with_suffix(".elsewhere"))
    with pytest.raises(InputError, match="which is not there; copy the whole folder"):
        Log.read(path.parent)


def test_dataflash_agrees_with_pymavlink(tmp_path: Path) -> None:
    """The reader that everybody uses gives the same numbers of every message."""
    pytest.importorskip("pymavlink")
    from pymavlink import DFReader

    from auvnn.logs.readers.dataflash import DataFlashReader

    path = foreign.binary(LOG, tmp_path / "log.BIN", quantised=True)
    recording = DataFlashReader().record(path)
    theirs = DFReader.DFReader_binary(str(path))
    rows: dict[str, list] = {}
    while (message := theirs.recv_msg()) is not None:
        rows.setdefault(message.get_type(), []).append(message.to_dict())
    for name in ("RATE", "RCOU"):
        mine = recording.topics[name]
        assert len(rows[name]) == len(mine.t)
        for label in mine.columns:
            np.testing.assert_array_equal(mine.columns[label], [r[label] for r in rows[name]])


def test_quantised_dataflash_is_near(tmp_path: Path) -> None:
    back = Log.read(foreign.binary(LOG, tmp_path / "log.BIN", quantised=True))
    found = differences(back)
    assert max(found[f"thruster_{i}"] for i in range(1, 5)) <= 0.5 / 400 + 1e-9
    assert max(v for n, v in found.items() if not n.startswith("thruster")) < 1e-5


def test_zeros_within_dataflash_are_skipped_and_counted(tmp_path: Path) -> None:
    path = foreign.binary(LOG, tmp_path / "log.BIN")
    content = bytearray(path.read_bytes())
    content[9000:9400] = bytes(400)
    path.write_bytes(content)
    back = Log.read(path)
    assert RUN.samples - 6 <= back.samples < RUN.samples
    assert any("damaged or lost" in r.what for r in back.repairs)


def test_a_reboot_within_dataflash_begins_another_run(tmp_path: Path) -> None:
    path = foreign.binary(LOG, tmp_path / "log.BIN")
    path.write_bytes(path.read_bytes() * 2)
    back = Log.read(path)
    assert [r.samples for r in back.runs] == [RUN.samples, RUN.samples]
    np.testing.assert_allclose(back.runs[1].nu, back.runs[0].nu)
    assert any("restarts of the clock" in r.what for r in back.repairs)


def test_mcap_without_its_end_is_read(tmp_path: Path) -> None:
    path = written("mcap", tmp_path)
    content = path.read_bytes()
    at = content.rfind(b"\x0f", 0, len(content) - 100)
    path.write_bytes(content[: len(content) - 30] if at < 0 else content[:at])
    assert Log.read(path).samples == RUN.samples


def test_a_flipped_bit_in_an_mcap_chunk_is_not_read_as_a_number(tmp_path: Path) -> None:
    path = written("mcap", tmp_path)
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 4
    path.write_bytes(content)
    try:
        back = Log.read(path)
    except InputError:
        return
    assert max(differences(back).values(), default=0.0) < 1e-9 or back.samples < RUN.samples


def test_a_length_of_gigabytes_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x06" + (290 * 10**9).to_bytes(8, "little") + bytes(50))
    with pytest.raises(InputError, match="holds no messages"):
        Log.read(path)


def test_imc_checksums_are_looked_at(tmp_path: Path) -> None:
    pytest.importorskip("imcpy")
    path = foreign.lsf(LOG, tmp_path / "Data.lsf")
    content = bytearray(path.read_bytes())
    content[60] ^= 1
    path.write_bytes(content)
    back = Log.read(path)
    assert back.samples == RUN.samples - 1
    assert any("wrong checksum" in r.what for r in back.repairs)


def test_the_crc_of_imc_is_that_of_its_standard() -> None:
    from auvnn.logs.readers.imc import crc16

    # The published check value of CRC-16/ARC.
    assert crc16(np.frombuffer(b"123456789", np.uint8)[None, :])[0] == 0xBB3D


def test_an_index_beside_an_imc_log_is_never_opened(tmp_path: Path) -> None:
    pytest.importorskip("imcpy")
    path = foreign.lsf(LOG, tmp_path / "Data.lsf")
    trap = tmp_path / "Data.imcpy_idx"
    trap.mkdir()  # whoever opened it would fail
    assert Log.read(path).samples == RUN.samples


def test_what_a_timetable_becomes(tmp_path: Path) -> None:
    from scipy.io import savemat

    path = tmp_path / "log.mat"
    savemat(path, {"note": "no numbers"})
    with pytest.raises(InputError, match="no array"):
        Log.read(path)


def test_frames_that_lie_are_refused(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    path = written("mcap", tmp_path)
    content = path.read_bytes().replace(b"/odom", b"/odom")
    path.write_bytes(content)
    recording = look(path).recording
    odometry = recording.topics.pop("/odom")
    odometry.name = "/mavros/global_position/local"
    recording.topics[odometry.name] = odometry
    from auvnn.logs.mapping_rules import propose
    from auvnn.logs.reading.mapping_file.mapping import Mapping
    from auvnn.logs.reading.recordings.assemble import from_recording

    proposal = propose(recording)
    assert "u" not in proposal.mapping["columns"]
    assert "mavros fills its twist" in proposal.refused[odometry.name]
    plan = {"columns": {"u": f"{odometry.name}.twist.twist.linear.x", "thruster_1": "/thrusters.data[0]"}}
    with pytest.raises(InputError, match="is refused as a source of 'u'"):
        from_recording(recording, Mapping.read(plan), "bag")
    trusted = Mapping.read(plan | {"topics": {odometry.name: {"trust": True, "body": "FLU"}}})
    assert from_recording(recording, trusted, "bag").rows == len(odometry.t)


def test_looking_says_what_there_is_and_the_mapping_reads_it(tmp_path: Path) -> None:
    pytest.importorskip("mcap_ros2")
    from auvnn.logs.inspect_file import write_mapping

    path = written("mcap", tmp_path)
    seen = look(path)
    lines = "\n".join(seen.lines())
    assert (
        "/odom nav_msgs/msg/Odometry" in lines
        and "at 20 Hz" in lines
        and "u <- twist.twist.linear.x" in lines
    )
    out = write_mapping(seen, tmp_path / "map.yaml")
    by_file, without = Log.read(path, out), Log.read(path)
    for a, b in zip(by_file.runs[0].columns(), without.runs[0].columns(), strict=True):
        assert a[0] == b[0]
        np.testing.assert_array_equal(a[1], b[1])
    with pytest.raises(InputError, match="is there already"):
        write_mapping(seen, tmp_path / "map.yaml")
