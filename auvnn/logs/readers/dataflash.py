"""ArduPilot's DataFlash logs (`.BIN`): packets whose layout the file itself describes in FMT messages.

https://ardupilot.org/copter/docs/common-downloading-and-analyzing-data-logs-in-mission-planner.html: every packet is
A3 95, a message number and the fields; message 128 (FMT) holds number, length, name, format and labels of each kind.
The format's own hundredths (c, C, e, E) and 1e-7 (L) are applied, as pymavlink does; further multipliers (FMTU) are not.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.readers.packets import chain, columns
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic, Wanted

_HEAD = b"\xa3\x95\x80"
_FMT, _FMT_LENGTH = 128, 89
_CODES = {
    "b": "i1", "B": "u1", "M": "u1", "h": "<i2", "H": "<u2", "c": "<i2", "C": "<u2", "i": "<i4", "I": "<u4",
    "e": "<i4", "E": "<u4", "L": "<i4", "f": "<f4", "d": "<f8", "q": "<i8", "Q": "<u8", "g": "<f2",
    "n": "S4", "N": "S16", "Z": "S64", "a": "64u1",
}  # fmt: skip
_FACTORS = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}
_INSTANCES = ("I", "C", "IMU", "Instance", "Id")
_BLOCK = 32_000_000
_REBOOT = 1.0  # s; a clock that falls by more began anew


@dataclass(frozen=True)
class Format:
    """One kind of message, as its FMT message says.

    Args:
        name: up to four letters.
        length: of the packet with its three bytes of header.
        codes: one letter for each field.
        labels: their names.
    """

    name: str
    length: int
    codes: str
    labels: tuple[str, ...]

    @property
    def record(self) -> np.dtype:
        """The packet as a numpy record."""
        kinds = []
        for code in self.codes:
            kind = _CODES[code]
            kinds.append(("u1", (64,)) if kind == "64u1" else kind)
        return np.dtype([("_head", "u1", (3,)), *zip(self.labels, kinds, strict=True)])


class DataFlashReader(RecordingReader):
    """ArduPilot's onboard logs."""

    name = "dataflash"
    suffixes = (".bin",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts with a packet, or one begins soon."""
        return head[:2] == _HEAD[:2] or head[:512].find(_HEAD) >= 0

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the messages that are wanted."""
        where = str(path)
        try:
            data = np.memmap(path, np.uint8, "r")
        except (OSError, ValueError) as problem:
            raise InputError(f"{where}: cannot be read: {problem}") from None
        notes: list[Repair] = []
        formats = _formats(data, where, notes)
        if not formats:
            raise InputError(
                f"{where}: holds no description of its messages (FMT): no DataFlash log, or damaged"
            )
        places, lost, breaks, unknown = _packets(data, formats)
        if not places:
            raise InputError(f"{where}: holds no messages: no DataFlash log, or damaged")
        _say(where, len(data), lost, breaks, unknown, notes)
        read = _Read(data, formats, places, where)
        parts = read.settle_clock(notes)
        facts = {"parameters": read.parameters()}
        topics: dict[str, Topic] = {}
        for number, form in formats.items():
            if number not in places or form.name in ("FMT", "FMTU", "UNIT", "MULT", "PARM", "MSG"):
                continue
            if wanted is None or wanted(form.name, "dataflash"):
                topics |= read.topics(number)
        return Recording(topics, notes, facts, parts)


def _formats(data: NDArray[np.uint8], where: str, notes: list[Repair]) -> dict[int, Format]:
    found: dict[int, Format] = {}
    bad = twice = 0
    for at in _find(data, _HEAD):
        if at + _FMT_LENGTH > len(data):
            continue
        raw = data[at : at + _FMT_LENGTH].tobytes()
        number, length = raw[3], raw[4]
        name, codes, labels = (
            raw[a:b].rstrip(b"\0").decode("latin-1") for a, b in ((5, 9), (9, 25), (25, 89))
        )
        names = tuple(label for label in labels.split(",") if label)
        if not re.fullmatch(r"[A-Za-z0-9_]{1,4}", name):
            continue
        if any(c not in _CODES for c in codes) or len(codes) != len(names) or len(set(names)) != len(names):
            bad += 1
            continue
        form = Format(name, length, codes, names)
        if not codes or form.record.itemsize != length or not all(re.fullmatch(r"\w+", n) for n in names):
            bad += 1
        elif number in found and found[number] != form:
            twice += 1
        else:
            found.setdefault(number, form)
    if bad:
        words = "descriptions of messages (FMT) that cannot be right left out with their messages"
        notes.append(Repair(words, where, bad, "warning", "copy the log from the vehicle again"))
    if twice:
        words = "messages described a second time in another way; the first description counts"
        notes.append(Repair(words, where, twice, "warning"))
    return found


def _find(data: NDArray[np.uint8], mark: bytes) -> list[int]:
    found: list[int] = []
    for at in range(0, len(data), _BLOCK):
        part = np.asarray(data[at : at + _BLOCK + len(mark) - 1])
        if len(part) < len(mark):
            break
        hit = part[: len(part) - len(mark) + 1] == mark[0]
        for i, byte in enumerate(mark[1:], 1):
            hit &= part[i : len(part) - len(mark) + 1 + i] == byte
        found += (np.flatnonzero(hit) + at).tolist()
    return found


def _packets(
    data: NDArray[np.uint8], formats: dict[int, Format]
) -> tuple[dict[int, NDArray[np.int64]], int, int, dict[int, int]]:
    """Return by message number where its packets begin, bytes and breaks lost, and numbers without a description."""
    lengths = np.zeros(256, np.int64)
    for number, form in formats.items():
        lengths[number] = form.length
    lengths[_FMT] = _FMT_LENGTH
    places: dict[int, list[NDArray[np.int64]]] = {}
    unknown: dict[int, int] = {}
    lost = breaks = 0
    at = 0
    while at < len(data):
        stop = min(at + _BLOCK, len(data))
        part = np.asarray(data[at:stop])
        hit = (
            np.flatnonzero((part[:-2] == 0xA3) & (part[1:-1] == 0x95))
            if len(part) > 2
            else np.zeros(0, np.int64)
        )
        kinds = part[hit + 2]
        described = lengths[kinds] > 0
        strange = np.bincount(kinds[~described], minlength=256)
        starts, kinds = hit[described], kinds[described]
        last = stop == len(data)
        end = len(part)
        if not last and len(starts):
            # A packet that the block cuts is left for the next one.
            inside = starts + lengths[kinds] <= end
            first_out = int(np.argmin(inside)) if not inside.all() else len(starts)
            end = int(starts[first_out]) if first_out < len(starts) else end
            starts, kinds = starts[:first_out], kinds[:first_out]
        taken, gone, broken = chain(starts, lengths[kinds], end)
        for number in np.unique(kinds[taken]):
            mine = taken[kinds[taken] == number]
            places.setdefault(int(number), []).append(starts[mine] + at)
        lost += gone
        breaks += broken
        if broken:
            unknown |= {int(k): unknown.get(int(k), 0) + int(strange[k]) for k in np.flatnonzero(strange)}
        at += max(end, 1)
    return {k: np.concatenate(v) for k, v in places.items()}, lost, breaks, unknown


def _say(where: str, size: int, lost: int, breaks: int, unknown: dict[int, int], notes: list[Repair]) -> None:
    if lost > 0 and breaks:
        words = f"places where bytes are damaged or lost, {100.0 * lost / size:.2g} % of the file left out"
        notes.append(Repair(words, where, breaks, "warning", "copy the log from the vehicle again"))
    often = {k: n for k, n in unknown.items() if n >= 3}
    if often:
        told = ", ".join(map(str, sorted(often)[:20]))
        words = f"messages without a description left out (numbers {told})"
        notes.append(Repair(words, where, sum(often.values()), "warning"))


class _Read:
    def __init__(
        self,
        data: NDArray[np.uint8],
        formats: dict[int, Format],
        places: dict[int, NDArray[np.int64]],
        where: str,
    ) -> None:
        self.data, self.formats, self.places, self.where = data, formats, places, where
        self.cuts: list[int] = []
        self.shifts: list[float] = [0.0]
        self.first = 0.0

    def values(self, number: int) -> NDArray[Any]:
        return columns(self.data, self.places[number], self.formats[number].record)

    def parameters(self) -> dict[str, float]:
        for number, form in self.formats.items():
            if form.name == "PARM" and number in self.places and {"Name", "Value"} <= set(form.labels):
                raw = self.values(number)
                names = [n.decode("latin-1") if isinstance(n, bytes) else "" for n in raw["Name"].tolist()]
                with np.errstate(all="ignore"):
                    numbers = (
                        raw["Value"].astype(np.float64)
                        if raw["Value"].dtype.kind in "fiu"
                        else np.zeros(len(raw))
                    )
                return {n: float(v) for n, v in zip(names, numbers, strict=True) if np.isfinite(v)}
        return {}

    def settle_clock(self, notes: list[Repair]) -> tuple[float, ...]:
        """Find where the clock began anew; what comes after is put behind what came before."""
        number = max(
            (n for n, f in self.formats.items() if n in self.places and "TimeUS" in f.labels),
            key=lambda n: len(self.places[n]), default=None,
        )  # fmt: skip
        if number is None:
            return ()
        stamps = self._seconds(self.values(number), self.formats[number])
        back = np.flatnonzero(np.diff(stamps) < -_REBOOT) + 1
        # Damage makes single stamps jump; a reboot goes on from where it fell to.
        back = [
            int(b)
            for b in back
            if np.median(stamps[b : b + 5]) < np.median(stamps[max(0, b - 5) : b]) - _REBOOT
        ]
        usual = float(np.median(stamps[:5]))
        self.first = float(stamps[0]) if abs(stamps[0] - usual) < 10.0 else usual
        edges = [0, *back, len(stamps)]
        parts = []
        behind = 0.0
        for begin, a, b in zip(edges, edges[1:], edges[2:], strict=False):
            before = stamps[begin:a]
            behind += float(np.max(before)) - float(np.min(stamps[a:b])) + 10.0
            self.cuts.append(int(self.places[number][a]))
            self.shifts.append(behind)
            parts.append(float(np.min(stamps[a:b])) + behind - 5.0 - self.first)
        if back:
            words = "restarts of the clock (a reboot, or two logs in one file): split there into further runs"
            notes.append(Repair(words, self.where, len(back), "warning"))
        return tuple(parts)

    def _seconds(self, raw: NDArray[Any], form: Format) -> NDArray[np.float64]:
        for label, factor in (("TimeUS", 1e-6), ("TimeMS", 1e-3)):
            if label in form.labels and raw[label].dtype.kind in "iu":
                return raw[label].astype(np.float64) * factor
        return np.full(len(raw), np.nan)

    def topics(self, number: int) -> dict[str, Topic]:
        form = self.formats[number]
        raw = self.values(number)
        part = np.searchsorted(np.array(self.cuts, np.int64), self.places[number], side="right")
        t = self._seconds(raw, form) - self.first + np.array(self.shifts)[part]
        found: dict[str, NDArray[Any]] = {}
        for code, label in zip(form.codes, form.labels, strict=True):
            values = raw[label]
            if values.ndim == 1 and values.dtype.kind in "iuf":
                with np.errstate(all="ignore"):
                    found[label] = values.astype(np.float64) * _FACTORS.get(code, 1.0)
        label = next((n for n in _INSTANCES if n in found), None)
        kinds = (
            np.unique(found[label]) if label and form.codes[form.labels.index(label)] in "bB" else np.zeros(0)
        )
        if label is None or len(kinds) == 0 or len(kinds) > 16 or _once_each(found[label], kinds, form.name):
            return {form.name: Topic(form.name, "dataflash", t, found)}
        out = {}
        for kind in kinds:
            keep = found[label] == kind
            name = f"{form.name}[{kind:g}]"
            out[name] = Topic(name, "dataflash", t[keep], {n: v[keep] for n, v in found.items()})
        return out


def _once_each(values: NDArray[Any], kinds: NDArray[Any], name: str) -> bool:
    """Say whether a field that is called like an instance is none: one value throughout, in a message of one instance."""
    return len(kinds) == 1 and not name.startswith(("XK", "NK"))
