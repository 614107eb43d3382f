"""MCAP, the usual container of ROS 2: records one after the other, in chunks that carry a checksum.

Read from the front without the summary at the end, which a recording that was cut off does not have. Every length is
compared with the file and every checksum that is there with its chunk. The message indices behind a chunk name the
channels in it: one that holds nothing but topics that nobody asks for, pictures mostly, is passed over and not unpacked.
https://mcap.dev/spec
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO

from auvnn.errors import InputError
from auvnn.logs.readers.ros import Channel, Message, Notes, RosReader
from auvnn.logs.readers.unpack import LIMIT, unpack
from auvnn.logs.reading.repairs.repair import Repair

MAGIC = b"\x89MCAP0\r\n"
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK, _INDEX, _DATA_END, _FOOTER = 3, 4, 5, 6, 7, 15, 2
_INDICES = 10_000  # behind one chunk that are looked at


class _Damage(ValueError):
    """A record contradicts itself."""


class McapReader(RosReader):
    """ROS 2 messages in MCAP."""

    name = "mcap"
    suffixes = (".mcap",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts as MCAP does."""
        return head.startswith(MAGIC)

    def messages(
        self, path: Path, wanted: Callable[[Channel], bool], most: int | None, notes: Notes
    ) -> Iterator[Message]:
        """Yield messages; the rest of a damaged file is left out with a note."""
        try:
            with path.open("rb") as stream:
                state = _State(wanted, str(path), stream)
                size = stream.seek(0, 2)
                stream.seek(len(MAGIC))
                yield from _records(stream, size, most, state, notes)
        except OSError as problem:
            raise InputError(f"{path}: cannot be read: {problem.strerror}") from None
        for words, count in state.left_out.items():
            notes.append(Repair(words, str(path), count, "info"))


class _State:
    def __init__(self, wanted: Callable[[Channel], bool], where: str, stream: BinaryIO) -> None:
        self.wanted, self.where, self.stream = wanted, where, stream
        self.schemas: dict[int, tuple[str, str, str]] = {}
        self.channels: dict[int, Channel | None] = {}
        self.left_out: dict[str, int] = {}
        # Place and length of the chunks that were passed over, in which a channel may be announced.
        self.passed: list[tuple[int, int]] = []


def _records(stream: BinaryIO, size: int, most: int | None, state: _State, notes: Notes) -> Iterator[Message]:
    where, end = state.where, size if most is None else min(size, most)
    bad_chunks = 0
    while (place := stream.tell()) < end:
        head = stream.read(9)
        if len(head) < 9:
            break
        kind, length = head[0], int.from_bytes(head[1:], "little")
        if kind in (_DATA_END, _FOOTER):
            _say_chunks(bad_chunks, where, notes)
            return
        if length > size - place - 9 or kind == 0:
            lost = 100.0 * (size - place) / size
            words = f"cut short or damaged at byte {place}: the last {lost:.2g} % of the file left out"
            notes.append(
                Repair(words, where, 1, "warning", "copy it again, or repair it with `mcap recover`")
            )
            break
        if kind not in (_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK) or length > LIMIT:
            stream.seek(length, 1)
            continue
        if kind == _CHUNK and _unwanted(stream, place + 9, length, size, state):
            state.passed.append((place + 9, length))
            stream.seek(place + 9 + length)
            continue
        stream.seek(place + 9)
        data = stream.read(length)
        try:
            if kind == _CHUNK:
                yield from list(_inside(_chunk(data, where), state))
            else:
                yield from _one(kind, data, state)
        except (_Damage, InputError, struct.error, IndexError):
            bad_chunks += 1
    _say_chunks(bad_chunks, where, notes)


def _unwanted(stream: BinaryIO, place: int, length: int, size: int, state: _State) -> bool:
    """Say whether the indices behind a chunk name channels that are known and not wanted, and no others."""
    if all(channel is not None for channel in state.channels.values()):
        return False
    at, found = place + length, 0
    while at + 11 <= size and found < _INDICES:
        stream.seek(at)
        head = stream.read(11)
        if len(head) < 11 or head[0] != _INDEX:
            break
        number = int.from_bytes(head[9:], "little")
        if number not in state.channels or state.channels[number] is not None:
            return False
        found += 1
        at += 9 + int.from_bytes(head[1:9], "little")
    return found > 0


def _recall(state: _State) -> None:
    """Take the channels that chunks announce which were passed over: a message of one of them comes later."""
    passed, stream = state.passed, state.stream
    state.passed = []
    here = stream.tell()
    for place, length in passed:
        stream.seek(place)
        try:
            data = _chunk(stream.read(length), state.where)
            for kind, start, stop in _places(data):
                if kind in (_SCHEMA, _CHANNEL):
                    list(_one(kind, data[start:stop], state))
        except (_Damage, InputError, struct.error, IndexError):
            continue
    stream.seek(here)


def _places(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield kind, begin and end of the records of a chunk, as far as they fit into it."""
    place = 0
    while place + 9 <= len(data):
        stop = place + 9 + int.from_bytes(data[place + 1 : place + 9], "little")
        if stop > len(data):
            return
        yield data[place], place + 9, stop
        place = stop


def _say_chunks(count: int, where: str, notes: Notes) -> None:
    if count:
        words = "parts whose checksum or content is damaged left out"
        notes.append(Repair(words, where, count, "warning", "copy the file again"))


def _chunk(data: bytes, where: str) -> bytes:
    size, crc, length = struct.unpack_from("<QII", data, 16)
    at = 32 + length
    if at + 8 > len(data):
        raise _Damage("chunk")
    method = data[32:at].decode("ascii", "replace")
    packed = int.from_bytes(data[at : at + 8], "little")
    if packed != len(data) - at - 8:
        raise _Damage("chunk")
    out = unpack(method, data[at + 8 :], size, where)
    if crc and zlib.crc32(out) != crc:
        raise _Damage("chunk")
    return out


def _inside(data: bytes, state: _State) -> Iterator[Message]:
    place, end = 0, len(data)
    channels = state.channels
    unpack_head = struct.Struct("<BQHIQQ").unpack_from
    while place + 9 <= end:
        kind = data[place]
        if kind == _MESSAGE and place + 31 <= end:
            _, length, number, _, logged, _ = unpack_head(data, place)
            stop = place + 9 + length
            if stop > end or length < 22:
                raise _Damage("record")
            if number not in channels and state.passed:
                _recall(state)
            channel = channels.get(number)
            if channel is not None:
                yield channel, logged, data[place + 31 : stop]
            place = stop
            continue
        length = int.from_bytes(data[place + 1 : place + 9], "little")
        stop = place + 9 + length
        if stop > end:
            raise _Damage("record")
        if kind in (_SCHEMA, _CHANNEL):
            yield from _one(kind, data[place + 9 : stop], state)
        place = stop


def _one(kind: int, data: bytes, state: _State) -> Iterator[Message]:
    if kind == _MESSAGE:
        number, _, logged, _ = struct.unpack_from("<HIQQ", data)
        if number not in state.channels and state.passed:
            _recall(state)
        channel = state.channels.get(number)
        if channel is not None:
            yield channel, logged, data[22:]
    elif kind == _SCHEMA:
        number = struct.unpack_from("<H", data)[0]
        name, at = _text(data, 2)
        encoding, at = _text(data, at)
        length = struct.unpack_from("<I", data, at)[0]
        state.schemas[number] = name, encoding, data[at + 4 : at + 4 + length].decode("utf-8", "replace")
    else:
        number, schema = struct.unpack_from("<HH", data)
        if number in state.channels:
            return
        topic, at = _text(data, 4)
        encoding, at = _text(data, at)
        name, language, text = state.schemas.get(schema, ("", "", ""))
        if encoding != "cdr" or language not in ("ros2msg", "ros2idl"):
            words = f"topics that are no ROS 2 messages ({encoding or 'no encoding'}) left out"
            state.left_out[words] = state.left_out.get(words, 0) + 1
            state.channels[number] = None
            return
        channel = Channel(topic, name, text, language == "ros2idl")
        state.channels[number] = channel if state.wanted(channel) else None


def _text(data: bytes, at: int) -> tuple[str, int]:
    length = struct.unpack_from("<I", data, at)[0]
    if length > len(data) - at - 4:
        raise _Damage("text")
    return data[at + 4 : at + 4 + length].decode("utf-8", "replace"), at + 4 + length
