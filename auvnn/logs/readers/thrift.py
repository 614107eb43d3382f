"""A reader for Thrift's compact protocol, as far as Parquet uses it: bytes to nested plain data."""

from __future__ import annotations

import struct
from typing import Any

_MAX_DEPTH = 24
_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)

Struct = dict[int, Any]


class ThriftError(ValueError):
    """The bytes are not in the compact protocol."""


class Cursor:
    """A place in a buffer that moves on as values are read.

    Args:
        data: the buffer.
        place: first byte to read.
        end: first byte that must not be read.
    """

    def __init__(self, data: Any, place: int, end: int) -> None:
        """Start at a place."""
        self.data, self.place, self.end = data, place, end

    def struct(self, depth: int = 0) -> Struct:
        """Return the struct that starts here, by field number.

        Raises:
            ThriftError: it is damaged.
        """
        if depth > _MAX_DEPTH:
            raise ThriftError("nested too deeply")
        fields: Struct = {}
        number = 0
        while header := self._byte():
            kind, step = header & 15, header >> 4
            number = number + step if step else self._zigzag()
            fields[number] = kind == _TRUE if kind in (_TRUE, _FALSE) else self._value(kind, depth)
        return fields

    def _byte(self) -> int:
        if self.place >= self.end:
            raise ThriftError("ends in the middle")
        self.place += 1
        return int(self.data[self.place - 1])

    def _bytes(self, count: int) -> bytes:
        if count < 0 or count > self.end - self.place:
            raise ThriftError("ends in the middle")
        self.place += count
        return bytes(self.data[self.place - count : self.place])

    def _varint(self) -> int:
        value = 0
        for shift in range(0, 70, 7):
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise ThriftError("a number has no end")

    def _zigzag(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)

    def _value(self, kind: int, depth: int) -> Any:
        if kind in (_I16, _I32, _I64):
            return self._zigzag()
        if kind == _BINARY:
            return self._bytes(self._varint())
        if kind == _STRUCT:
            return self.struct(depth + 1)
        if kind in (_LIST, _SET):
            return self._list(depth)
        if kind == _DOUBLE:
            return struct.unpack("<d", self._bytes(8))[0]
        if kind in (_BYTE, _TRUE, _FALSE):
            return self._byte()
        if kind == _MAP:
            return self._map(depth)
        raise ThriftError(f"no type {kind}")

    def _count(self, count: int) -> int:
        # Every element takes at least one byte: a damaged length must not fill the memory.
        if count > self.end - self.place:
            raise ThriftError("a list is longer than the file")
        return count

    def _list(self, depth: int) -> list[Any]:
        if depth > _MAX_DEPTH:
            raise ThriftError("nested too deeply")
        header = self._byte()
        kind, count = header & 15, header >> 4
        count = self._count(self._varint() if count == 15 else count)
        return [self._value(kind, depth + 1) for _ in range(count)]

    def _map(self, depth: int) -> list[tuple[Any, Any]]:
        if depth > _MAX_DEPTH:
            raise ThriftError("nested too deeply")
        count = self._count(self._varint())
        if not count:
            return []
        kinds = self._byte()
        return [
            (self._value(kinds >> 4, depth + 1), self._value(kinds & 15, depth + 1)) for _ in range(count)
        ]
