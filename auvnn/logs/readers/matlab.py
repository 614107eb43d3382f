"""MATLAB files up to version 7, read by scipy after their own lengths have been compared.

https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf: elements of a tag (type, bytes) and data, arrays of
sub-elements (flags, dimensions, name, numbers), perhaps compressed by zlib.
"""

from __future__ import annotations

import io
import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.errors import InputError, one_line
from auvnn.logs.readers.arrays import to_recording
from auvnn.logs.readers.memory import refuse_more_than_memory
from auvnn.logs.readers.recordings import RecordingReader
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Wanted

_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_RATIO = 1100  # no more than zlib can pack
_MOST = 400_000_000  # bytes, or ten times the file
_OPAQUE, _CELL = 17, 1
_DEPTH = 8


class MatlabReader(RecordingReader):
    """Arrays and structures of a `.mat` file."""

    name = "matlab"
    suffixes = (".mat",)

    def recognises(self, head: bytes) -> bool:
        """Say whether the file starts with MATLAB's text and is not HDF5 behind it."""
        return head.startswith(b"MATLAB") and head[512:516] != b"\x89HDF"

    def record(self, path: Path, wanted: Wanted | None = None, until: float | None = None) -> Recording:
        """Read all arrays of numbers."""
        from scipy.io import loadmat

        where = str(path)
        notes: list[Repair] = []
        try:
            raw = path.read_bytes()
        except OSError as problem:
            raise InputError(f"{where}: cannot be read: {problem.strerror}") from None
        plain = _checked(raw, where, notes)
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                found = loadmat(io.BytesIO(plain), simplify_cells=True, verify_compressed_data_integrity=True)
        except MemoryError:
            raise InputError(
                f"{where}: is a damaged MATLAB file: it asks for more memory than there is"
            ) from None
        except Exception as problem:  # scipy raises what its parts raise
            raise InputError(f"{where}: is a damaged MATLAB file ({one_line(problem, 120)})") from None
        arrays: dict[str, Any] = {}
        _flatten(found, "", arrays, 0)
        return to_recording(arrays, where, notes)


def _flatten(node: dict[str, Any], prefix: str, out: dict[str, Any], depth: int) -> None:
    for name, value in node.items():
        if str(name).startswith("__") or depth > _DEPTH:
            continue
        path = f"{prefix}.{name}" if prefix else str(name)
        if isinstance(value, dict):
            _flatten(value, path, out, depth + 1)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "iufb":
            out[path] = value


def _checked(raw: bytes, where: str, notes: list[Repair]) -> bytes:
    """Return the file with its compressed elements unpacked and those left out that contradict themselves.

    Raises:
        InputError: nothing is left.
    """
    if len(raw) < _HEADER + 8:
        raise InputError(f"{where}: is cut short: {len(raw)} bytes are no MATLAB file; copy it again")
    order = {b"IM": "<", b"MI": ">"}.get(raw[126:128])
    if order is None:
        raise InputError(f"{where}: is a MATLAB file of version 4 or damaged; save it with -v7")
    limit = max(_MOST, 10 * len(raw))
    # Nothing is copied before it must be: a file without packed and damaged parts is read as it is.
    whole, plain = memoryview(raw), True
    out: list[bytes | memoryview] = [whole[:_HEADER]]
    at, total, bad, opaque = _HEADER, 0, 0, 0
    while at + 8 <= len(raw):
        kind, size = struct.unpack_from(order + "II", raw, at)
        data = whole[at + 8 : at + 8 + size]
        at += 8 + size
        if len(data) < size:
            notes.append(
                Repair("cut short: the last array left out", where, 1, "warning", "copy the file again")
            )
            break
        if kind == _COMPRESSED:
            plain = False
            worker = zlib.decompressobj()
            try:
                data = memoryview(worker.decompress(data, min(limit - total, _RATIO * len(data) + 1024) + 1))
            except zlib.error:
                bad += 1
                continue
            if not worker.eof or len(data) < 8:
                bad += 1
                continue
            kind, size = struct.unpack_from(order + "II", data)
            data = data[8:]
        total += len(data)
        if total > limit:
            raise InputError(
                f"{where}: unpacks to more than {limit / 1e6:.0f} MB: no log is packed so tightly"
            )
        if kind != _MATRIX or size != len(data):
            bad += 1
            continue
        verdict = _array(data, order, 0)
        if verdict == "opaque":
            opaque += 1
        elif verdict:
            bad += 1
        else:
            out += [struct.pack(order + "II", kind, len(data)), data]
    if opaque:
        words = (
            "objects of MATLAB (timetable, timeseries, datetime, string) left out: only MATLAB can read them"
        )
        notes.append(Repair(words, where, opaque, "warning", "save their columns as plain arrays"))
    if bad:
        notes.append(Repair("damaged arrays left out", where, bad, "warning", "copy the file again"))
    if len(out) == 1:
        cure = "save the columns of timetables and timeseries as plain arrays" if opaque else "copy it again"
        raise InputError(f"{where}: holds no array that can be read; {cure}")
    if plain and not bad and not opaque and at == len(raw):
        refuse_more_than_memory(total, where)
        return raw
    refuse_more_than_memory(2 * total, where)
    return b"".join(out)


_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}


def _array(data: memoryview, order: str, depth: int) -> str:
    """Return what is wrong with the lengths within an array, "" where nothing is."""
    if depth > _DEPTH:
        return "nested too deeply"
    parts = _parts(data, order)
    if parts is None or len(parts) < 2:
        return "" if not data else "lengths"
    if parts[0][0] != 6 or len(parts[0][1]) != 8:
        return "flags"
    kind = struct.unpack_from(order + "I", parts[0][1])[0] & 0xFF
    complex_values = bool(struct.unpack_from(order + "I", parts[0][1])[0] & 0x0800)
    if kind == _OPAQUE or kind == 3 or kind == 16:
        return "opaque"
    sizes = parts[1]
    if sizes[0] != 5 or len(sizes[1]) % 4 or not 8 <= len(sizes[1]) <= 128 or len(parts) < 3:
        return "dimensions"
    shape = np.frombuffer(sizes[1], order + "i4")
    if (shape < 0).any():
        return "dimensions"
    count = 1
    for n in shape.tolist():
        count *= n
    if count > len(data) and kind in (_CELL, 2):
        return "more cells than bytes"
    rest = parts[3:]
    if kind in (_CELL, 2):
        inner = rest if kind == _CELL else rest[2:]
        if kind == 2 and (len(rest) < 2 or rest[0][0] != 5 or len(rest[0][1]) != 4):
            return "fields"
        return next((v for t, d in inner if t == _MATRIX and (v := _array(d, order, depth + 1))), "")
    if 6 <= kind <= 15 or kind == 4:
        values = rest[: 2 if complex_values else 1]
        if len(values) < (2 if complex_values else 1):
            return "" if count == 0 else "numbers"
        for number, numbers in values:
            if number not in _SIZES or len(numbers) != count * _SIZES[number]:
                return "numbers" if kind != 4 else ""
        return ""
    return "opaque" if kind == 5 else "class"


def _parts(data: memoryview, order: str) -> list[tuple[int, memoryview]] | None:
    parts: list[tuple[int, memoryview]] = []
    at = 0
    while at + 8 <= len(data):
        first, size = struct.unpack_from(order + "II", data, at)
        if first >> 16:  # up to four bytes stand within the tag
            size = first >> 16
            if size > 4:
                return None
            parts.append((first & 0xFFFF, data[at + 4 : at + 4 + size]))
            at += 8
            continue
        if size > len(data) - at - 8:
            return None
        parts.append((first, data[at + 8 : at + 8 + size]))
        at += 8 + size + (-size % 8)
    return parts
