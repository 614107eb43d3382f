"""What ROS recordings have in common, whatever holds the messages: topics, types, raw bytes in, columns out."""

from __future__ import annotations

from abc import abstractmethod
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import InputError
from auvnn.logs.readers import ros_definitions
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.readers.ros_layout import Decoder
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic, Wanted

_BATCH = 2_000
_BATCH_BYTES = 8_000_000
_MERGED = 32  # batches that are put together as soon as there are so many
_SURVEY = 60  # messages of a topic that are decoded to see what it holds
SURVEY_BYTES = 48_000_000
_FIELDS = 400  # columns of a topic that are shown
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
                columns[channel] = _Columns(channel, self._decoder(channel, where, notes), first)
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

    def _decoder(self, channel: Channel, where: str, notes: Notes) -> Decoder | None:
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
        return Decoder(channel.kind, definitions, self.packed)


class _Columns:
    """Messages of one topic on their way to columns."""

    def __init__(self, channel: Channel, decoder: Decoder | None, first: int | None) -> None:
        self.channel, self.decoder, self.first = channel, decoder, first
        self.waiting: list[bytes] = []
        self.bytes = 0
        # Eight bytes a message: a list of Python's integers takes five times as much.
        self.arrivals = array("q")
        self.parts: list[dict[str, Any]] = []
        self.sizes: list[int] = []
        self.decoded = self.count = self.last = self.merged = 0

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
            self.parts.append(self.decoder.decode(self.waiting))
            self.sizes.append(len(self.waiting))
            self.decoded += len(self.waiting)
            if len(self.parts) == self.merged + _MERGED:
                self._merge()
        self.waiting, self.bytes = [], 0

    def _merge(self) -> None:
        """Put the last parts together: memory of large arrays goes back as they are freed, that of small ones stays."""
        parts, sizes = self.parts[self.merged :], self.sizes[self.merged :]
        names = dict.fromkeys(name for part in parts for name in part)
        self.parts[self.merged :] = [{name: _joined(parts, sizes, name) for name in names}]
        self.sizes[self.merged :] = [sum(sizes)]
        self.merged += 1

    def note(self, where: str, notes: Notes) -> None:
        if self.decoder is not None and self.decoder.bad:
            words = f"messages that do not fit {self.channel.kind} left out: the first {self.decoder.why}"
            notes.append(Repair(words, f"{where}, {self.channel.topic}", self.decoder.bad, "warning"))

    def topic(self, epoch: int) -> Topic:
        arrival = ((np.array(self.arrivals, dtype=np.int64) - epoch) * 1e-9).astype(np.float64)
        names = list(dict.fromkeys(name for part in self.parts for name in part))[:_FIELDS]
        columns = {}
        for name in names:
            # Taken out one by one: all of them twice would be the most that reading needs.
            columns[name] = _joined(self.parts, self.sizes, name)
        words = {}
        if self.decoder is not None:
            words = {p: w for p, w in self.decoder.words.items() if p not in self.decoder.changing}
        sec, nano = columns.pop("header.stamp.sec", None), columns.pop("header.stamp.nanosec", None)
        t = arrival
        if sec is not None and nano is not None and len(sec) == len(arrival):
            with np.errstate(invalid="ignore"):
                whole = np.nan_to_num(sec).astype(np.int64) * 1_000_000_000 + np.nan_to_num(nano).astype(
                    np.int64
                )
            if (whole != 0).any():
                t = np.where(whole == 0, np.nan, (whole - epoch) * 1e-9).astype(np.float64)
        return Topic(self.channel.topic, self.channel.kind, t, columns, words, arrival, self.count)


def _joined(parts: list[dict[str, Any]], sizes: list[int], name: str) -> np.ndarray[Any, Any]:
    """Take a column out of the parts and return it in one, (N,); NaN where a part has none."""
    return np.concatenate([p.pop(name, np.full(n, np.nan)) for p, n in zip(parts, sizes, strict=True)])


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
