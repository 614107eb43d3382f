"""ROS 1 bags, version 2.0: records with named header fields, messages in chunks.

Read from the front, without the index at the end, which a bag that was cut off does not have.
http://wiki.ros.org/Bags/Format/2.0
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

from auvnn.errors import InputError
from auvnn.logs.readers.ros import Channel, Message, Notes, RosReader
from auvnn.logs.readers.unpack import LIMIT, unpack
from auvnn.logs.reading.repairs.repair import Repair

MAGIC = b"#ROSBAG V2.0\n"
_MESSAGE, _CHUNK, _CONNECTION = 2, 5, 7
_LONGEST_HEADER = 1_000_000


class _Damage(ValueError):
    """A record contradicts itself."""


class Ros1Reader(RosReader):
    """ROS 1 messages in a bag."""

    name = "rosbag1"
    suffixes = (".bag",)
    packed = True

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as a ROS 1 bag does."""
        return head.startswith(b"#ROSBAG V")

    def messages(
        self, path: Path, wanted: Callable[[Channel], bool], most: int | None, notes: Notes
    ) -> Iterator[Message]:
        """Yield messages; the rest of a damaged file is left out with a note."""
        where = str(path)
        channels: dict[int, Channel | None] = {}
        bad = 0
        try:
            with path.open("rb") as stream:
                size = stream.seek(0, 2)
                stream.seek(0)
                if stream.read(len(MAGIC)) != MAGIC:
                    raise InputError(
                        f"{where}: is a ROS bag of another version than 2.0: `rosbag fix` can repair that"
                    )
                end = size if most is None else min(size, most)
                while (place := stream.tell()) < end:
                    try:
                        fields = _header(stream.read(_length(stream.read(4), size - place)))
                        length = _length(stream.read(4), size - stream.tell())
                    except _Damage:
                        lost = 100.0 * (size - place) / size
                        words = f"cut short or damaged at byte {place}: the last {lost:.2g} % of the file left out"
                        notes.append(
                            Repair(words, where, 1, "warning", "copy it again, or `rosbag reindex` it")
                        )
                        break
                    kind = fields.get(b"op", b"\0")[:1]
                    if kind not in (b"\x02", b"\x05", b"\x07") or length > LIMIT:
                        stream.seek(length, 1)
                        continue
                    data = stream.read(length)
                    try:
                        if kind == b"\x05":
                            method = fields.get(b"compression", b"none").decode("ascii", "replace")
                            claimed = int.from_bytes(fields.get(b"size", b""), "little")
                            plain = unpack("" if method == "none" else method, data, claimed, where)
                            yield from list(_inside(plain, channels, wanted))
                        else:
                            yield from _one(fields, data, channels, wanted)
                    except (_Damage, InputError):
                        bad += 1
        except OSError as problem:
            raise InputError(f"{where}: cannot be read: {problem.strerror}") from None
        if bad:
            notes.append(Repair("damaged parts left out", where, bad, "warning", "copy the file again"))


def _length(four: bytes, most: int) -> int:
    length = int.from_bytes(four, "little")
    if len(four) < 4 or length > most:
        raise _Damage("length")
    return length


def _header(data: bytes) -> dict[bytes, bytes]:
    if len(data) > _LONGEST_HEADER:
        raise _Damage("header")
    fields, at = {}, 0
    while at < len(data):
        length = _length(data[at : at + 4], len(data) - at - 4)
        name, equals, value = data[at + 4 : at + 4 + length].partition(b"=")
        if not equals:
            raise _Damage("field")
        fields[name] = value
        at += 4 + length
    return fields


def _inside(
    data: bytes, channels: dict[int, Channel | None], wanted: Callable[[Channel], bool]
) -> Iterator[Message]:
    at = 0
    while at < len(data):
        length = _length(data[at : at + 4], len(data) - at - 4)
        fields = _header(data[at + 4 : at + 4 + length])
        at += 4 + length
        length = _length(data[at : at + 4], len(data) - at - 4)
        yield from _one(fields, data[at + 4 : at + 4 + length], channels, wanted)
        at += 4 + length


def _one(
    fields: dict[bytes, bytes],
    data: bytes,
    channels: dict[int, Channel | None],
    wanted: Callable[[Channel], bool],
) -> Iterator[Message]:
    kind = fields.get(b"op", b"\0")[0] if fields.get(b"op") else 0
    number = int.from_bytes(fields.get(b"conn", b""), "little")
    if kind == _MESSAGE:
        channel = channels.get(number)
        stamp = fields.get(b"time", b"")
        if channel is not None and len(stamp) == 8:
            seconds, nano = int.from_bytes(stamp[:4], "little"), int.from_bytes(stamp[4:], "little")
            yield channel, seconds * 1_000_000_000 + nano, data
    elif kind == _CONNECTION and number not in channels:
        inner = _header(data)
        topic = fields.get(b"topic", b"").decode("utf-8", "replace")
        name = inner.get(b"type", b"").decode("utf-8", "replace")
        kind_name = name if "/msg/" in name else "/msg/".join(name.rsplit("/", 1))
        text = inner.get(b"message_definition", b"").decode("utf-8", "replace")
        channel = Channel(topic, kind_name, text)
        channels[number] = channel if wanted(channel) else None
