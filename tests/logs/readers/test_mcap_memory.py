"""A long MCAP costs the memory of the log that it becomes, and pictures in it cost nothing."""

from __future__ import annotations

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from auvnn.logs import Log
from auvnn.logs.readers import mcap as reader
from auvnn.logs.readers import ros
from auvnn.logs.reading.mapping_file import frames
from auvnn.logs.reading.recordings import rates
from auvnn.logs.reading.stacking import stacked
from auvnn.logs.recording import Asked
from tests.logs.foreign_formats import COMMANDS_TEXT, ODOMETRY, START

pytest.importorskip("mcap")
IMAGE = "uint32 height\nuint32 width\nuint8[] data\n"
STEP = 20_000_000  # ns


def odometry(stamp: int, values: np.ndarray) -> bytes:
    """Return an Odometry in CDR: position 3, quaternion 4 and velocity 6 as they are."""
    data = bytes([0, 1, 0, 0]) + struct.pack("<iII", stamp // 10**9, stamp % 10**9, 5) + b"odom\0" + bytes(3)
    data += struct.pack("<I", 10) + b"base_link\0"
    data += bytes(-(len(data) - 4) % 8)
    return data + values[:7].tobytes() + bytes(288) + values[7:].tobytes() + bytes(288)


def written(path: Path, rows: int, picture: bytes = b"", every: int = 50, late: bool = False) -> Path:
    """Write rows of Odometry and eight commands, by the library of the format itself, put into CDR by hand.

    Args:
        path: of the file.
        rows: of both.
        picture: data of an image that is written between them.
        every: rows between two pictures.
        late: whether the commands are announced in a chunk that holds a picture alone.
    """
    from mcap.writer import CompressionType, Writer

    rng = np.random.default_rng(0)
    t = 0.02 * np.arange(rows)
    yaw = np.sin(0.1 * t)
    zero = np.zeros(rows)
    pose = [5 * np.sin(0.1 * t), 5 * np.cos(0.1 * t), np.sin(0.2 * t) - 3, zero, zero, np.sin(yaw / 2)]
    values = np.stack([*pose, np.cos(yaw / 2), *rng.normal(size=(6, rows))], axis=1)
    commands = np.clip(0.3 * rng.normal(size=(rows, 8)), -1, 1)
    with path.open("wb") as stream:
        size = 1 << 16
        writer = Writer(stream, chunk_size=size, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="test")

        def topic(name: str, kind: str, text: str) -> int:
            return writer.register_channel(
                name, "cdr", writer.register_schema(kind, "ros2msg", text.encode())
            )

        odom = topic("/odom", "nav_msgs/msg/Odometry", ODOMETRY)
        image = topic("/image", "test_msgs/msg/Picture", IMAGE)
        told = -1 if late else topic("/thrusters", "std_msgs/msg/Float64MultiArray", COMMANDS_TEXT)
        for k in range(rows):
            stamp = START + k * STEP
            if k % every == 0 and picture:
                data = bytes([0, 1, 0, 0]) + struct.pack("<III", 1, len(picture), len(picture)) + picture
                if k:
                    getattr(writer, "_Writer__finalize_chunk")()  # noqa: B009  the picture begins a chunk
                if told < 0 and k:
                    told = topic("/thrusters", "std_msgs/msg/Float64MultiArray", COMMANDS_TEXT)
                writer.add_message(image, stamp, data, stamp)
            writer.add_message(odom, stamp, odometry(stamp, values[k]), stamp)
            if told >= 0:
                head = bytes([0, 1, 0, 0]) + struct.pack("<IIII", 0, 0, 8, 0)
                writer.add_message(told, stamp, head + commands[k].tobytes(), stamp)
        writer.finish()
    return path


def test_memory_grows_with_the_log_and_not_with_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of 22 numbers a row, and what is needed on the way, which is a group of columns and the stamps."""
    for module in (ros, frames, rates):
        monkeypatch.setattr(module, "_BLOCK", 500)
    monkeypatch.setattr(ros, "_BATCH", 100)
    paths = {rows: written(tmp_path / f"{rows}.mcap", rows) for rows in (500, 4_000, 8_000)}
    Log.read(paths.pop(500))  # what is loaded once is not counted
    peak, size = {}, {}
    for rows, path in paths.items():
        tracemalloc.start()
        log = Log.read(path)
        peak[rows] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        run = log.runs[0]
        blocks = (run.t, run.quaternion, run.nu, run.position, run.thrusters)
        size[rows] = sum(b.nbytes for b in blocks if b is not None)
        assert log.samples == rows and size[rows] == 22 * 8 * rows
    a, b = paths
    # 2.1 where commands, stamps and row numbers are held twice, 3.1 where every field is kept and every step copies.
    assert (peak[b] - peak[a]) / (size[b] - size[a]) < 1.6


def test_commands_are_where_they_were_read_to(tmp_path: Path) -> None:
    """The widest block of a log is not copied on its way, and a field that comes late or not at all is missing."""
    path = written(tmp_path / "log.mcap", 60)
    asked = Asked(frozenset(f"/thrusters.data[{k}]" for k in range(8)))
    columns = reader.McapReader().record(path, asked).topics["/thrusters"].columns
    each = [columns[f"data[{k}]"] for k in range(8)]
    whole = stacked(list(each))
    assert whole.shape == (60, 8) and np.shares_memory(whole, each[3])
    np.testing.assert_array_equal(whole, np.stack(each, axis=1))
    # In another order, or some of them, they are a block of their own.
    other = stacked([each[1], each[0]])
    np.testing.assert_array_equal(other, np.stack([each[1], each[0]], axis=1))
    assert not np.shares_memory(other, each[0]) and not np.shares_memory(stacked(list(each[::-1])), each[0])


def test_a_chunk_of_pictures_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    picture = np.random.default_rng(1).integers(0, 255, 300_000, dtype=np.uint8).tobytes()
    unpacked: list[int] = []

    def counted(method: str, data: bytes, size: int, where: str) -> bytes:
        unpacked.append(size)
        return unpack(method, data, size, where)

    unpack = reader.unpack
    plain = Log.read(written(tmp_path / "plain.mcap", 400)).runs[0]
    path = written(tmp_path / "pictures.mcap", 400, picture)
    monkeypatch.setattr(reader, "unpack", counted)
    rows = reader.McapReader().record(path, lambda name, kind: name != "/image").topics["/odom"]
    # One picture lies in the first chunk, in which the channels are announced; the seven others cost nothing.
    assert len(rows.t) == 400 and sum(unpacked) < 2 * len(picture) + 500_000
    run = Log.read(path).runs[0]
    for name, column in plain.columns():
        np.testing.assert_array_equal(run[name], column)


def test_a_channel_that_a_chunk_of_pictures_announces_is_known(tmp_path: Path) -> None:
    """The commands begin behind the second picture, in whose chunk they are announced, and no message of them is."""
    path = written(tmp_path / "late.mcap", 200, bytes(200_000), every=100, late=True)
    topics = reader.McapReader().record(path, lambda name, kind: name != "/image").topics
    assert len(topics["/odom"].t) == 200 and len(topics["/thrusters"].t) == 100


def test_a_field_that_is_not_there_is_answered_with_those_that_are(tmp_path: Path) -> None:
    from auvnn.errors import InputError

    path = written(tmp_path / "log.mcap", 50)
    plan = {"columns": {"u": "/odom.twist.twist.linear.X", "thruster_1": "/thrusters.data[0]"}}
    with pytest.raises(InputError, match=r"twist\.twist\.linear\.x"):
        Log.read(path, plan)
