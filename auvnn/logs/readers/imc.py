"""Logs of LSTS vehicles (`.lsf`, `.lsf.gz`): IMC packets, each with a checksum.

A packet is a header of 20 bytes (sync FE54, message number, size, time as double, source, its entity, destination, its
entity), the fields in order, and a CRC-16-IBM. The messages below are those of the IMC definition that a log may need;
where an `IMC.xml` or `IMC.xml.gz` lies beside the log, as DUNE puts it, its definitions are used. Index files beside the
log, which could hold code, are never opened.
"""

from __future__ import annotations

import re
import zlib
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic, Wanted

_HEADER, _FOOTER = 20, 2
_SYNC = 0xFE54
_XML_LIMIT, _UNPACKED_LIMIT, _RATIO = 20_000_000, 4_000_000_000, 200
_VECTOR = "time=f8 x=f8 y=f8 z=f8"
_MESSAGES = {
    350: ("EstimatedState", "lat=f8 lon=f8 height=f4 x=f4 y=f4 z=f4 phi=f4 theta=f4 psi=f4 u=f4 v=f4 w=f4 vx=f4 vy=f4 "
          "vz=f4 p=f4 q=f4 r=f4 depth=f4 alt=f4"),
    50: ("SimulatedState", "lat=f8 lon=f8 height=f4 x=f4 y=f4 z=f4 phi=f4 theta=f4 psi=f4 u=f4 v=f4 w=f4 p=f4 q=f4 r=f4 "
         "svx=f4 svy=f4 svz=f4"),
    351: ("EstimatedStreamVelocity", "x=f8 y=f8 z=f8"), 301: ("SetThrusterActuation", "id=u1 value=f4"),
    302: ("SetServoPosition", "id=u1 value=f4"), 281: ("ServoPosition", "id=u1 value=f4"), 250: ("Rpm", "value=i2"),
    259: ("GroundVelocity", "validity=u1 x=f8 y=f8 z=f8"), 260: ("WaterVelocity", "validity=u1 x=f8 y=f8 z=f8"),
    256: ("AngularVelocity", _VECTOR), 257: ("Acceleration", _VECTOR),
    254: ("EulerAngles", "time=f8 phi=f8 theta=f8 psi=f8 psi_magnetic=f8"),
    265: ("Depth", "value=f4"), 264: ("Pressure", "value=f8"), 263: ("Temperature", "value=f4"),
    251: ("Voltage", "value=f4"), 252: ("Current", "value=f4"),
    407: ("DesiredControl", "x=f8 y=f8 z=f8 k=f8 m=f8 n=f8 flags=u1"), 315: ("SetPWM", "id=u1 period=u4 duty_cycle=u4"),
}  # fmt: skip
_KINDS = {
    "uint8_t": "u1", "int8_t": "i1", "uint16_t": "u2", "int16_t": "i2", "uint32_t": "u4", "int32_t": "i4",
    "int64_t": "i8", "fp32_t": "f4", "fp64_t": "f8",
}  # fmt: skip
_INVALID_BELOW_ZERO = {"EstimatedState": ("depth", "alt")}


def _crc_table() -> NDArray[np.uint16]:
    table = np.arange(256, dtype=np.int64)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ 0xA001, table >> 1)
    return table.astype(np.uint16)


_TABLE = _crc_table()


def crc16(packets: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """Return the CRC-16-IBM (polynomial 8005 reflected, from 0) of packets of one length, (N, L) to (N,)."""
    crc = np.zeros(len(packets), dtype=np.uint16)
    for byte in packets.T:
        crc = np.asarray((crc >> 8) ^ _TABLE[(crc ^ byte) & 0xFF], dtype=np.uint16)
    return crc


class ImcReader(RecordingReader):
    """Messages of the vehicle that logged, actuators as `SetThrusterActuation[0]`, sensors as `Voltage[entity]`."""

    name = "imc"
    suffixes = (".lsf", ".gz")

    def recognises(self, head: bytes) -> bool:
        """Say whether the file, or what is packed in it, starts with a packet."""
        if head.startswith(b"\x1f\x8b"):
            try:
                head = zlib.decompressobj(31).decompress(head, 64)
            except zlib.error:
                return False
        return head[:2] in (b"\x54\xfe", b"\xfe\x54")

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read the messages that are wanted."""
        where = str(path)
        notes: list[Repair] = []
        data = _bytes(path, where, notes)
        messages = _definitions(path, where, notes)
        order = "<" if data[:2].tobytes() == b"\x54\xfe" else ">"
        if data[:2].tobytes() not in (b"\x54\xfe", b"\xfe\x54"):
            order = "<"
        found, bad = _packets(data, messages, order)
        if not found:
            raise InputError(f"{where}: holds no IMC message with a right checksum: no log, or damaged")
        if bad:
            words = "messages with a wrong checksum left out"
            notes.append(Repair(words, where, bad, "warning", "copy the log again"))
        source = _own_source(found)
        topics: dict[str, Topic] = {}
        begin = min(float(np.nanmin(r["_time"])) for r in found.values())
        others = 0
        for number, records in found.items():
            name = messages[number][0]
            mine = records["_src"] == source
            others += int((~mine).sum())
            if wanted is None or wanted(name, "imc"):
                topics |= _topics(name, records[mine], begin)
        if others:
            notes.append(Repair("messages of other vehicles left out", where, others, "info"))
        return Recording(topics, notes)


def _bytes(path: Path, where: str, notes: list[Repair]) -> NDArray[np.uint8]:
    try:
        with path.open("rb") as stream:
            packed = stream.read(2) == b"\x1f\x8b"
        if not packed:
            return np.asarray(np.memmap(path, np.uint8, "r"))
        raw = path.read_bytes()
    except (OSError, ValueError) as problem:
        raise InputError(f"{where}: cannot be read: {problem}") from None
    limit = min(_UNPACKED_LIMIT, max(_RATIO * len(raw), 10_000_000))
    out = bytearray()
    rest = raw
    try:
        while rest:
            worker = zlib.decompressobj(31)
            out += worker.decompress(rest, limit - len(out) + 1)
            if len(out) > limit:
                raise InputError(
                    f"{where}: unpacks to more than {limit / 1e6:.0f} MB: no log is packed so tightly"
                )
            if not worker.eof:
                notes.append(
                    Repair("cut short: what could be unpacked is used", where, 1, "warning", "copy it again")
                )
                break
            rest = worker.unused_data
            if not rest.startswith(b"\x1f\x8b"):
                break
    except zlib.error:
        notes.append(Repair("damaged: what could be unpacked is used", where, 1, "warning", "copy it again"))
    if len(out) < _HEADER:
        raise InputError(f"{where}: cannot be unpacked: damaged; copy it again")
    return np.frombuffer(bytes(out), np.uint8)


def _definitions(path: Path, where: str, notes: list[Repair]) -> dict[int, tuple[str, str]]:
    for name in ("IMC.xml.gz", "IMC.xml"):
        beside = path.with_name(name)
        if not beside.is_file():
            continue
        try:
            text = beside.read_bytes()[: _XML_LIMIT + 1]
            if name.endswith("gz"):
                text = zlib.decompressobj(31).decompress(text, _XML_LIMIT)
            if b"<!DOCTYPE" in text or b"<!ENTITY" in text or len(text) > _XML_LIMIT:
                raise ValueError("it is no plain definition")
            return _MESSAGES | _from_xml(text)
        except (OSError, ValueError, zlib.error, ElementTree.ParseError) as problem:
            words = f"definitions not used ({problem})"
            notes.append(Repair(words, str(beside), 1, "warning"))
    return dict(_MESSAGES)


def _from_xml(text: bytes) -> dict[int, tuple[str, str]]:
    found = {}
    for message in ElementTree.fromstring(text).iter("message"):
        number, name = message.get("id", ""), message.get("abbrev", "")
        fields = [(f.get("abbrev", ""), _KINDS.get(f.get("type", ""))) for f in message.findall("field")]
        simple = all(kind and re.fullmatch(r"[A-Za-z]\w*", label) for label, kind in fields)
        labels = {label for label, _ in fields}
        if (
            number.isdigit()
            and int(number) < 65536
            and re.fullmatch(r"\w+", name)
            and fields
            and simple
            and len(labels) == len(fields)
        ):
            found[int(number)] = name, " ".join(f"{label}={kind}" for label, kind in fields)
    return found


def _record(fields: str, order: str) -> np.dtype:
    own = [
        (name, kind if kind[1] == "1" else order + kind)
        for name, _, kind in (f.partition("=") for f in fields.split())
    ]
    head = [
        ("_sync", "u2"),
        ("_id", "u2"),
        ("_size", "u2"),
        ("_time", "f8"),
        ("_src", "u2"),
        ("_ent", "u1"),
        ("_dst", "u2"),
        ("_dent", "u1"),
    ]
    return np.dtype([(n, k if k == "u1" else order + k) for n, k in head] + own + [("_crc", order + "u2")])


def _packets(
    data: NDArray[np.uint8], messages: dict[int, tuple[str, str]], order: str
) -> tuple[dict[int, NDArray], int]:
    """Return the messages with a right checksum by their number, and how many have a wrong one."""
    low, high = (0x54, 0xFE) if order == "<" else (0xFE, 0x54)
    if len(data) < _HEADER + _FOOTER:
        return {}, 0
    starts = np.flatnonzero((data[:-1] == low) & (data[1:] == high))
    starts = starts[starts + _HEADER + _FOOTER <= len(data)]
    word = np.array([1, 256] if order == "<" else [256, 1], np.int64)
    numbers = data[starts + 2] * word[0] + data[starts + 3] * word[1]
    sizes = data[starts + 4] * word[0] + data[starts + 5] * word[1]
    found: dict[int, NDArray] = {}
    bad = 0
    for number in np.unique(numbers):
        if int(number) not in messages:
            continue
        record = _record(messages[int(number)][1], order)
        mine = starts[(numbers == number) & (sizes == record.itemsize - _HEADER - _FOOTER)]
        mine = mine[mine + record.itemsize <= len(data)]
        kept = []
        for at in range(0, len(mine), 20_000):
            raw = data[mine[at : at + 20_000, None] + np.arange(record.itemsize)]
            view = np.ascontiguousarray(raw).view(record)[:, 0]
            right = (crc16(raw[:, :-2]) == view["_crc"]) & np.isfinite(view["_time"])
            bad += int((~right).sum())
            kept.append(view[right])
        if kept and sum(map(len, kept)):
            found[int(number)] = np.concatenate(kept)
    return found, bad


def _own_source(found: dict[int, NDArray]) -> int:
    """Return the vehicle that logged: whose estimated states there are most of, else whose messages."""
    records = found[350]["_src"] if 350 in found else np.concatenate([r["_src"] for r in found.values()])
    values, counts = np.unique(records, return_counts=True)
    return int(values[counts.argmax()])


def _topics(name: str, records: NDArray, begin: float) -> dict[str, Topic]:
    if not len(records):
        return {}
    fields = [n for n in records.dtype.names or () if not n.startswith("_")]
    t = records["_time"].astype(np.float64) - begin
    with np.errstate(all="ignore"):
        columns = {n: records[n].astype(np.float64) for n in fields}
    for field in _INVALID_BELOW_ZERO.get(name, ()):
        # The definition calls negative values invalid.
        columns[field] = np.where(columns[field] < 0.0, np.nan, columns[field])
    by = columns["id"] if "id" in columns else records["_ent"].astype(np.float64)
    kinds = np.unique(by)
    if "id" not in columns and len(kinds) == 1:
        return {name: Topic(name, "imc", t, columns)}
    if len(kinds) > 64:
        return {}
    if name == "EstimatedState":
        # Several estimators may run; the one that says most is the vehicle's own.
        kinds = kinds[
            [int((by == k).sum()) for k in kinds].index(max(int((by == k).sum()) for k in kinds)) :
        ][:1]
        keep = by == kinds[0]
        return {name: Topic(name, "imc", t[keep], {n: v[keep] for n, v in columns.items()})}
    out = {}
    for kind in kinds:
        keep = by == kind
        own = f"{name}[{int(kind)}]"
        out[own] = Topic(own, "imc", t[keep], {n: v[keep] for n, v in columns.items()})
    return out
