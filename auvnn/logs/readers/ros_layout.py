"""Where the numbers of a ROS message lie in its bytes, found by walking its definition; no code is generated.

ROS 2 messages are CDR: four bytes of header, then primitives aligned to their own size; ROS 1 messages are packed. A
text or a sequence has its length in front, so that messages of one type differ in layout only where such a length
does: those that agree are read together, as one numpy array.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "u1", "octet": "u1",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_MAX_DEPTH = 16
_MAX_ITEMS = 64  # of a sequence that are worth a column each; pictures and scans are longer
_MAX_FIELDS = 2_000
_MAX_WORD = 200
_MAX_LAYOUTS = 200  # among the messages of one batch

Definitions = Mapping[str, Any]
"""Message type to (constants, [(field, description)]), as rosbags parses them."""


class LayoutError(ValueError):
    """The bytes do not fit the message's definition."""


@dataclass(frozen=True)
class Layout:
    """Where the fields of one message lie.

    Args:
        size: of the message, bytes.
        fields: path to (offset, numpy format).
        lengths: offset and value of each length word; messages in which they agree have this layout.
        words: path to text.
    """

    size: int
    fields: dict[str, tuple[int, str]]
    lengths: tuple[tuple[int, int], ...]
    words: dict[str, str]


class _Walk:
    def __init__(self, data: bytes, definitions: Definitions, packed: bool) -> None:
        self.data, self.definitions, self.packed = data, definitions, packed
        self.start = 0
        self.order = "<"
        if not packed:
            if len(data) < 4 or data[0] != 0 or data[1] > 1:
                raise LayoutError("is not in plain CDR")
            self.start, self.order = 4, "<" if data[1] else ">"
        self.place = self.start
        self.fields: dict[str, tuple[int, str]] = {}
        self.lengths: list[tuple[int, int]] = []
        self.words: dict[str, str] = {}

    def message(self, name: str, path: str, depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise LayoutError("is nested too deeply")
        if name not in self.definitions:
            raise LayoutError(f"holds a {name}, whose definition is not known")
        for field, (kind, description) in self.definitions[name][1]:
            self.value(int(kind), description, f"{path}.{field}" if path else field, depth)

    def value(self, kind: int, description: Any, path: str, depth: int) -> None:
        if kind == 1:
            self.primitive(description[0], path)
        elif kind == 2:
            self.message(description, path, depth + 1)
        else:
            (inner, what), count = description
            if kind == 4:
                count = self.length()
            self.items(int(inner), what, int(count), path, depth)

    def items(self, inner: int, what: Any, count: int, path: str, depth: int) -> None:
        if inner == 1 and what[0] in PRIMITIVES and count > _MAX_ITEMS:
            size = int(PRIMITIVES[what[0]][1])
            self.align(size)
            self.skip(size * count)
            return
        if inner == 1 and what[0] in PRIMITIVES and path.endswith("covariance") and count > 1:
            # The first says whether there is one at all; nobody asks for the others.
            self.primitive(what[0], f"{path}[0]")
            self.skip(int(PRIMITIVES[what[0]][1]) * (count - 1))
            return
        if count > len(self.data):
            raise LayoutError("has a sequence longer than itself")
        for i in range(count):
            before = self.place
            self.value(inner, what, f"{path}[{i}]", depth)
            if self.place == before and i > _MAX_ITEMS:
                return  # of nothing there may be any number

    def align(self, size: int) -> None:
        if not self.packed:
            self.place += -(self.place - self.start) % size

    def skip(self, size: int) -> None:
        self.place += size
        if self.place > len(self.data):
            raise LayoutError("ends in the middle")

    def length(self) -> int:
        self.align(4)
        at = self.place
        self.skip(4)
        value = int.from_bytes(self.data[at : at + 4], "little" if self.order == "<" else "big")
        self.lengths.append((at, value))
        return value

    def primitive(self, name: str, path: str) -> None:
        if name in ("string", "wstring"):
            count = self.length()
            at = self.place
            self.skip(count)
            if count <= _MAX_WORD and len(self.words) < _MAX_FIELDS:
                text = self.data[at : at + count].rstrip(b"\0")
                self.words[path] = text.decode("utf-8", "replace")
            return
        if name in ("time", "duration"):  # ROS 1
            self.primitive("uint32" if name == "time" else "int32", f"{path}.sec")
            self.primitive("uint32" if name == "time" else "int32", f"{path}.nanosec")
            return
        if name not in PRIMITIVES:
            raise LayoutError(f"holds a {name}, which is not read")
        code = PRIMITIVES[name]
        size = int(code[1])
        self.align(size)
        at = self.place
        self.skip(size)
        if len(self.fields) >= _MAX_FIELDS:
            return
        self.fields[path] = (at, self.order + code if size > 1 else code)


def layout(data: bytes, kind: str, definitions: Definitions, packed: bool) -> Layout:
    """Return where the fields of a message lie.

    Args:
        data: the message.
        kind: its type, `nav_msgs/msg/Odometry`.
        definitions: of all types within it.
        packed: ROS 1, without CDR's header and alignment.

    Raises:
        LayoutError: the bytes do not fit the definition.
    """
    walk = _Walk(data, definitions, packed)
    walk.message(kind, "", 0)
    return Layout(len(data), walk.fields, tuple(walk.lengths), walk.words)


class Decoder:
    """Turns messages of one type into columns, batch by batch.

    Args:
        kind: message type.
        definitions: of all types within it.
        packed: ROS 1.
        fields: paths that are wanted; None for all.
    """

    def __init__(
        self, kind: str, definitions: Definitions, packed: bool, fields: frozenset[str] | None = None
    ) -> None:
        self.kind, self.definitions, self.packed, self.wanted = kind, definitions, packed, fields
        self.layouts: dict[int, list[Layout]] = {}
        self.words: dict[str, str] = {}
        self.changing: set[str] = set()
        self.bad = 0
        self.why = ""

    def decode(self, messages: list[bytes]) -> dict[str, NDArray[Any]]:
        """Return columns (N,) by path, NaN (or 0 in stamps) where a message has no such field or does not fit."""
        count = len(messages)
        sizes = np.fromiter((len(m) for m in messages), np.int64, count)
        out: dict[str, NDArray[Any]] = {}
        for size in np.unique(sizes):
            rows = np.flatnonzero(sizes == size)
            block = np.frombuffer(b"".join([messages[i] for i in rows]), np.uint8).reshape(len(rows), size)
            self._block(block, rows, count, out)
        return out

    def _block(
        self, block: NDArray[Any], rows: NDArray[Any], count: int, out: dict[str, NDArray[Any]]
    ) -> None:
        left = np.ones(len(rows), dtype=bool)
        known = self.layouts.setdefault(block.shape[1], [])
        for found in known:
            self._take(found, block, left, rows, count, out)
            if not left.any():
                return
        for _ in range(_MAX_LAYOUTS):
            first = int(left.argmax())
            try:
                found = layout(block[first].tobytes(), self.kind, self.definitions, self.packed)
            except LayoutError as problem:
                self.why = self.why or str(problem)
                self.bad += 1
                left[first] = False
            else:
                self._note(found.words)
                if len(known) < _MAX_LAYOUTS:
                    known.append(found)
                self._take(found, block, left, rows, count, out)
            if not left.any():
                return
        self.bad += int(left.sum())
        self.why = self.why or "their lengths differ in too many ways"

    def _take(
        self, found: Layout, block: NDArray[Any], left: NDArray[np.bool_], rows: NDArray[Any], count: int,
        out: dict[str, NDArray[Any]],
    ) -> None:  # fmt: skip
        order = "<" if self.packed or block[0, 1] == 1 else ">"
        fits = left.copy()
        if not self.packed:
            fits &= block[:, 1] == (1 if order == "<" else 0)
        for at, value in found.lengths:
            fits &= np.ascontiguousarray(block[:, at : at + 4]).view(order + "u4")[:, 0] == value
        if not fits.any():
            return
        part, where = block[fits], rows[fits]
        names = [n for n in found.fields if self.wanted is None or n in self.wanted]
        if names:
            kinds = [found.fields[n] for n in names]
            record = np.dtype(
                {
                    "names": names,
                    "formats": [k for _, k in kinds],
                    "offsets": [a for a, _ in kinds],
                    "itemsize": found.size,
                }
            )
            values = np.ascontiguousarray(part).view(record)[:, 0]
            for name in names:
                if name not in out:
                    whole = values.dtype[name].kind in "iu" and values.dtype[name].itemsize <= 4
                    out[name] = (
                        np.zeros(count, np.int64) if whole and _stamp(name) else np.full(count, np.nan)
                    )
                out[name][where] = values[name]
        left &= ~fits

    def _note(self, words: dict[str, str]) -> None:
        for path, word in words.items():
            if self.words.setdefault(path, word) != word:
                self.changing.add(path)


def _stamp(name: str) -> bool:
    return name.endswith(("stamp.sec", "stamp.nanosec"))
