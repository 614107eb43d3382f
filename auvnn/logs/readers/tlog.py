"""Telemetry logs of MAVLink ground stations (`.tlog`): each message behind the time of its arrival.

A record is the time, microseconds since 1970 as a big-endian integer of eight bytes, and a MAVLink frame, versions 1
and 2. Frames are found here and decoded by pymavlink, which checks their checksums.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import InputError, MissingExtra
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic, Wanted

_V1, _V2 = 0xFE, 0xFD
_EARLY, _LATE = 946_684_800_000_000, 4_102_444_800_000_000  # us: the years 2000 to 2100
_SURVEY = 60
_GROUND_STATION, _NO_AUTOPILOT = 6, 8
_CLOCKS = 5.0  # s
_INSTANCE_FIELDS = {"SERVO_OUTPUT_RAW": "port", "DISTANCE_SENSOR": "id", "BATTERY_STATUS": "id"}
_WRAP = {"time_usec": (1e-6, 2**32), "time_boot_ms": (1e-3, 2**32)}


class TlogReader(RecordingReader):
    """Messages of the vehicle's autopilot under their names, those of others as `NAME@system.component`."""

    name = "tlog"
    suffixes = (".tlog",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts with a time and a MAVLink frame."""
        return len(head) > 16 and _frame_at(head, 0) is not None

    def survey(self, path: Path) -> Recording:
        """Return the messages there are, with the first ones of each."""
        return self._record(path, None, None, _SURVEY)

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the messages that are wanted."""
        return self._record(path, wanted, until, None)

    def _record(self, path: Path, wanted: Wanted | None, until: float | None, first: int | None) -> Recording:
        where = str(path)
        try:
            from pymavlink.dialects.v20 import ardupilotmega as dialect
        except ImportError:
            raise MissingExtra("pymavlink", "mavlink", "reading telemetry logs") from None
        try:
            data = path.read_bytes()
        except OSError as problem:
            raise InputError(f"{where}: cannot be read: {problem.strerror}") from None
        frames, lost = _frames(data)
        if not frames:
            raise InputError(f"{where}: holds no MAVLink messages: no telemetry log, or damaged")
        notes: list[Repair] = []
        if lost:
            words = f"places where bytes are damaged or lost, {100.0 * sum(lost) / len(data):.2g} % of the file left out"
            notes.append(Repair(words, where, len(lost), "warning"))
        names = {number: kind.msgname for number, kind in dialect.mavlink_map.items()}
        vehicle = _vehicle(data, frames, dialect)
        found: dict[str, _Messages] = {}
        facts: dict[str, Any] = {"parameters": {}}
        parser: Any = dialect.MAVLink(None)
        parser.robust_parsing = False
        bad = 0
        begin = frames[0][0]
        for stamp, at, end, number, system, component in frames:
            name = names.get(number)
            if name is None or (until is not None and stamp - begin > (until + 1.0) * 1e6):
                continue
            full = name if (system, component) == vehicle else f"{name}@{system}.{component}"
            if name != "PARAM_VALUE" and wanted is not None and not wanted(full, "mavlink"):
                continue
            mine = found.setdefault(full, _Messages(name))
            mine.count += 1
            if first is not None and len(mine.stamps) >= first and name != "PARAM_VALUE":
                continue
            try:
                message = parser.decode(bytearray(data[at:end]))
            except Exception:  # a wrong checksum, or a field that no type holds
                bad += 1
                continue
            if name == "PARAM_VALUE":
                facts["parameters"][str(message.param_id)] = float(message.param_value)
                continue
            mine.add((stamp - begin) * 1e-6, message)
        if bad:
            notes.append(Repair("messages with a wrong checksum left out", where, bad, "warning"))
        topics: dict[str, Topic] = {}
        for name, messages in found.items():
            topics |= messages.topics(name)
        _boot_clock(topics)
        if not topics and wanted is None:
            raise InputError(f"{where}: holds no messages of a vehicle")
        return Recording(topics, notes, facts)


class _Messages:
    def __init__(self, name: str) -> None:
        self.name = name
        self.stamps: list[float] = []
        self.values: dict[str, list[Any]] = {}
        self.count = 0

    def add(self, stamp: float, message: Any) -> None:
        self.stamps.append(stamp)
        for field in message.get_fieldnames():
            value = getattr(message, field)
            if isinstance(value, (int, float)):
                self.values.setdefault(field, []).append(value)
            elif (
                isinstance(value, (list, tuple))
                and len(value) <= 32
                and all(isinstance(v, (int, float)) for v in value)
            ):
                for i, v in enumerate(value):
                    self.values.setdefault(f"{field}[{i}]", []).append(v)

    def topics(self, name: str) -> dict[str, Topic]:
        arrival = np.array(self.stamps)
        with np.errstate(all="ignore"):
            columns = {k: np.array(v, np.float64) for k, v in self.values.items() if len(v) == len(arrival)}
        if not columns:
            return {}
        whole = Topic(name, "mavlink", arrival, columns, {}, arrival, self.count)
        field = _INSTANCE_FIELDS.get(self.name)
        kinds = np.unique(columns[field]) if field in columns else np.zeros(0)
        if len(kinds) < 2 or len(kinds) > 16:
            return {name: whole}
        out = {}
        for kind in kinds:
            keep = columns[str(field)] == kind
            own = f"{name}[{kind:g}]"
            out[own] = Topic(
                own, "mavlink", arrival[keep], {k: v[keep] for k, v in columns.items()}, {}, arrival[keep]
            )
        return out


Frame = tuple[int, int, int, int, int, int]
"""Time, us; first and last byte of the frame; message number, system, component."""


def _frame_at(data: bytes, at: int) -> Frame | None:
    if at + 16 > len(data):
        return None
    stamp = int.from_bytes(data[at : at + 8], "big")
    if not _EARLY < stamp < _LATE:
        return None
    magic, length = data[at + 8], data[at + 9]
    if magic == _V1:
        end = at + 8 + 8 + length
        head = data[at + 13], data[at + 11], data[at + 12]
    elif magic == _V2:
        end = at + 8 + 12 + length + (13 if data[at + 10] & 1 else 0)
        if at + 18 > len(data):
            return None
        head = int.from_bytes(data[at + 15 : at + 18], "little"), data[at + 13], data[at + 14]
    else:
        return None
    return None if end > len(data) else (stamp, at + 8, end, *head)


def _frames(data: bytes) -> tuple[list[Frame], list[int]]:
    frames: list[Frame] = []
    lost: list[int] = []
    at = 0
    start = re.compile(rb"[\xfd\xfe]")
    while at + 16 <= len(data):
        frame = _frame_at(data, at)
        if frame is None:
            # The next time with a frame behind it that another follows, or the end.
            place = at + 1
            while (hit := start.search(data, place + 8)) is not None:
                place = hit.start() - 8
                near = _frame_at(data, place)
                if near is not None and (near[2] == len(data) or _frame_at(data, near[2]) is not None):
                    break
                place += 1
            else:
                place = len(data)
            lost.append(place - at)
            at = place
            continue
        frames.append(frame)
        at = frame[2]
    if at < len(data):
        lost.append(len(data) - at)
    return frames, lost


def _vehicle(data: bytes, frames: list[Frame], dialect: Any) -> tuple[int, int]:
    """Return system and component of the autopilot: the first heartbeat of one, else who says most about attitude."""
    attitude = Counter((f[4], f[5]) for f in frames if f[3] in (30, 31))
    for _, at, end, number, system, component in frames:
        if number == 0:
            payload = data[at + (10 if data[at] == _V2 else 6) : end]
            if len(payload) > 6 and payload[4] != _GROUND_STATION and payload[5] != _NO_AUTOPILOT:
                return system, component
    return attitude.most_common(1)[0][0] if attitude else (1, 1)


def _boot_clock(topics: dict[str, Topic]) -> None:
    """Stamp messages by the vehicle's own clock where they carry it: arrival is late by the radio's moods."""
    boot: dict[str, np.ndarray] = {}
    for name, topic in topics.items():
        for field, (scale, wrap) in _WRAP.items():
            ticks = topic.columns.get(field)
            if (
                ticks is not None
                and "@" not in name
                and len(ticks)
                and (ticks > 0).all()
                and ticks.max() < wrap
            ):
                turns = np.cumsum(np.concatenate([[0], np.diff(ticks) < -0.5 * wrap]))
                boot[name] = (ticks + turns * wrap) * scale
                break
    if not boot:
        return
    offsets = {n: float(np.median(topics[n].t - b)) for n, b in boot.items()}
    common = float(np.median(list(offsets.values())))
    # The quickest message of all is nearest to what the clocks differ by.
    near = {n: b for n, b in boot.items() if abs(offsets[n] - common) < _CLOCKS}
    offset = min(float((topics[n].t - b).min()) for n, b in near.items())
    for name, own in near.items():
        topics[name].t = own + offset
