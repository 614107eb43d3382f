"""What ROS recordings have in common, whatever holds the messages: topics, types, raw bytes in, columns out."""

from __future__ import annotations

from abc import abstractmethod
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.readers import ros_definitions
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.readers.ros_layout import Decoder
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Asked, Recording, Topic, Wanted

_BATCH = 2_000
_BATCH_BYTES = 8_000_000
_BLOCK = 65_536  # stamps that are converted at a time
_SURVEY = 60  # messages of a topic that are decoded to see what it holds
SURVEY_BYTES = 48_000_000
_FIELDS = 400  # columns of a topic that are shown
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
_CLOCKS = 5.0  # s between stamp and arrival, beyond which another clock is supposed


@dataclass(frozen=True)
class Channel:
    """One topic of a bag.

    Args:
        topic: name.
        kind: message type, `nav_msgs/msg/Odometry`.
        definition: text that comes with the bag, "" where it has none.
        idl: whether that is IDL.
    """

    topic: str
    kind: str
    definition: str = ""
    idl: bool = False


Message = tuple[Channel, int, bytes]
"""Channel, time of recording, ns, and bytes."""
Notes = list[Repair]


class RosReader(RecordingReader):
    """A container of ROS messages; a subclass says how to get them out."""

    packed = False

    @abstractmethod
    def messages(
        self, path: Path, wanted: Callable[[Channel], bool], most: int | None, notes: Notes
    ) -> Iterator[Message]:
        """Yield the messages of wanted topics in the order of the file, of its first `most` bytes.

        Args:
            path: of the file.
            wanted: whether a channel's messages are asked for.
            most: bytes of the file that are looked at; all of them where None.
            notes: to which what was left out is added.
        """

    def survey(self, path: Path) -> Recording:
        """Return the topics with their first messages, by the beginning of a long file."""
        return self._record(path, None, None, _SURVEY, SURVEY_BYTES)

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the topics that are wanted."""
        return self._record(path, wanted, until, None, None)

    def _record(
        self, path: Path, wanted: Wanted | None, until: float | None, first: int | None, most: int | None
    ) -> Recording:
        where = str(path)
        notes: Notes = []
        columns: dict[Channel, _Columns] = {}
        begin: int | None = None

        def chosen(channel: Channel) -> bool:
            return wanted is None or wanted(channel.topic, channel.kind)

        for channel, stamp, data in self.messages(path, chosen, most, notes):
            begin = stamp if begin is None else begin
            if until is not None and stamp - begin > (until + 1.0) * 1e9:
                break
            if channel not in columns:
                fields = wanted.fields(channel.topic) if isinstance(wanted, Asked) else None
                columns[channel] = _Columns(channel, self._decoder(channel, where, notes, fields), first)
            columns[channel].add(stamp, data)
        for found in columns.values():
            found.flush()
            found.note(where, notes)
        if not columns:
            if wanted is not None and not notes:
                return Recording({}, notes)
            raise InputError(
                f"{where}: is a {self.name} recording and holds no messages"
                + (f": {notes[0].what}" if notes else "")
            )
        epoch = begin or 0
        topics: dict[str, Topic] = {}
        for found in columns.values():
            topic = found.topic(epoch)
            name = topic.name if topic.name not in topics else f"{topic.name} ({topic.kind})"
            topics[name] = topic
        _clocks(topics, where, notes)
        return Recording(topics, notes)

    def _decoder(
        self, channel: Channel, where: str, notes: Notes, fields: frozenset[str] | None
    ) -> Decoder | None:
        definitions = {**ros_definitions.common(), **self.extra_definitions}
        if channel.definition:
            try:
                definitions |= ros_definitions.parse(channel.definition, channel.kind, channel.idl)
            except InputError as problem:
                notes.append(Repair(str(problem), f"{where}, {channel.topic}", 1, "warning"))
        if not ros_definitions.known_kinds([channel.kind], definitions):
            words = f"topic left out: the definition of {channel.kind} is not in the file"
            cure = "name a folder of .msg files in the mapping: definitions: folder"
            notes.append(Repair(words, f"{where}, {channel.topic}", 1, "info", cure))
            return None
        return Decoder(
            channel.kind, definitions, self.packed, None if fields is None else fields | set(_STAMP)
        )


class _Columns:
    """Messages of one topic on their way to columns.

    Each column is one array of Python that grows by `realloc`, which moves the pages of a large array and does not copy
    them: neither a list of parts nor their concatenation is ever held beside the columns.
    """

    def __init__(self, channel: Channel, decoder: Decoder | None, first: int | None) -> None:
        self.channel, self.decoder, self.first = channel, decoder, first
        self.waiting: list[bytes] = []
        self.bytes = 0
        # Eight bytes a message: a list of Python's integers takes five times as much.
        self.arrivals, self.stamps = array("q"), array("q")
        self.columns: dict[str, array[Any]] = {}
        # Of a sequence that is asked for, the items lie row by row, as a log's commands do: they are not copied again.
        self.rows: dict[str, tuple[list[str], array[Any]]] = {}
        self.decoded = self.count = self.last = 0

    def add(self, stamp: int, data: bytes) -> None:
        self.count += 1
        self.last = stamp
        if self.decoder is None or (
            self.first is not None and self.decoded + len(self.waiting) >= self.first
        ):
            if self.decoder is None and len(self.arrivals) < _SURVEY:
                self.arrivals.append(stamp)
            return
        self.arrivals.append(stamp)
        self.waiting.append(data)
        self.bytes += len(data)
        if len(self.waiting) >= _BATCH or self.bytes > _BATCH_BYTES:
            self.flush()

    def flush(self) -> None:
        if self.waiting and self.decoder is not None:
            count = len(self.waiting)
            part = self.decoder.decode(self.waiting)
            sec, nano = (part.pop(name, None) for name in _STAMP)
            if sec is not None and nano is not None:
                if not self.stamps:
                    self.stamps.frombytes(bytes(8 * self.decoded))
                self.stamps.frombytes((sec * 1_000_000_000 + nano).tobytes())
            elif self.stamps:
                self.stamps.frombytes(bytes(8 * count))
            self._side_by_side(part, count)
            for name, values in part.items():
                if name not in self.columns:
                    if len(self.columns) >= _FIELDS and self.decoder.wanted is None:
                        continue
                    self.columns[name] = _missing(values.dtype, self.decoded)
                self.columns[name].frombytes(values.tobytes())
            for name, column in self.columns.items():
                if name not in part:
                    column.extend(_missing(np.dtype("f8" if column.typecode == "d" else "i8"), count))
            self.decoded += count
        self.waiting, self.bytes = [], 0

    def _side_by_side(self, part: dict[str, NDArray[Any]], count: int) -> None:
        """Take the items of the sequences that are asked for out of a batch and keep them row by row."""
        assert self.decoder is not None
        if not self.decoded and self.decoder.wanted is not None:
            for name, values in part.items():
                if name.endswith("]") and values.dtype == np.float64:
                    self.rows.setdefault(name[: name.rindex("[")], ([], array("d")))[0].append(name)
        for names, kept in self.rows.values():
            block = np.full((count, len(names)), np.nan)
            for k, name in enumerate(names):
                if name in part:
                    block[:, k] = part.pop(name)
            kept.frombytes(block.tobytes())

    def note(self, where: str, notes: Notes) -> None:
        if self.decoder is not None and self.decoder.bad:
            words = f"messages that do not fit {self.channel.kind} left out: the first {self.decoder.why}"
            notes.append(Repair(words, f"{where}, {self.channel.topic}", self.decoder.bad, "warning"))

    def topic(self, epoch: int) -> Topic:
        arrival = _seconds(self.arrivals, epoch)
        self.arrivals = array("q")
        words = {}
        if self.decoder is not None:
            words = {p: w for p, w in self.decoder.words.items() if p not in self.decoder.changing}
        t = arrival
        if len(self.stamps) == len(arrival) and np.frombuffer(self.stamps, np.int64).any():
            t = _seconds(self.stamps, epoch, zero_is_missing=True)
        self.stamps = array("q")
        kinds = {"d": np.float64, "q": np.int64}
        columns = {n: np.frombuffer(c, kinds[c.typecode]) for n, c in self.columns.items()}
        for names, kept in self.rows.values():
            columns |= zip(names, np.frombuffer(kept, np.float64).reshape(-1, len(names)).T, strict=True)
        return Topic(self.channel.topic, self.channel.kind, t, columns, words, arrival, self.count)


def _missing(kind: np.dtype[Any], count: int) -> array[Any]:
    """Return so many missing values: NaN, or 0 in the parts of stamps."""
    whole = kind.kind in "iu"
    return array("q" if whole else "d", bytes(8 * count) if whole else np.full(count, np.nan).tobytes())


def _seconds(stamps: array[int], epoch: int, zero_is_missing: bool = False) -> np.ndarray[Any, Any]:
    """Return stamps in ns as s since an epoch, (N,), without a second array of their length on the way."""
    whole = np.frombuffer(stamps, np.int64)
    out = np.empty(len(whole))
    for at in range(0, len(whole), _BLOCK):
        part = whole[at : at + _BLOCK]
        seconds = (part - epoch) * 1e-9
        out[at : at + _BLOCK] = np.where(part == 0, np.nan, seconds) if zero_is_missing else seconds
    return out


def _clocks(topics: dict[str, Topic], where: str, notes: Notes) -> None:
    """Put topics that are stamped by another computer's clock in addition to the others, by when they were recorded."""
    for topic in topics.values():
        if topic.arrival is None or topic.t is topic.arrival or not np.isfinite(topic.t).any():
            continue
        behind = float(np.nanmedian(topic.arrival - topic.t))
        if abs(behind) > _CLOCKS:
            # The smallest difference is that of the quickest message: nearest to the offset of the clocks.
            offset = float(np.nanmin(topic.arrival - topic.t))
            topic.t = topic.t + offset
            words = (
                f"stamped by another clock, {behind:.3f} s from the recorder's: set to the time of recording"
            )
            cure = f"give its true offset in the mapping: clocks: {{{topic.name}: {{offset: auto}}}}"
            notes.append(Repair(words, f"{where}, {topic.name}", len(topic.t), "warning", cure))
