"""Taking typed fields out of a mapping: each refusal names the file, the field, the value and the cure."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np

from auvnn.catalogue import unknown_name
from auvnn.errors import ModelError
from auvnn.vehicle.parts import Array

# Beyond this no SI number of a vehicle is meant, and products of such numbers would overflow.
LARGEST = 1e12
# And below this nothing that must be positive is.
SMALLEST = 1e-12
MAX_PARTS = 256
MAX_TABLE = 10_000


def shown(value: Any) -> str:
    """Return a value as it is shown in a message: short, on one line."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 80 else text[:77] + "..."


def refuse(where: str, field: str, value: Any, problem: str, cure: str) -> ModelError:
    """Return the error for one field.

    Args:
        where: of the file.
        field: its name.
        value: what stands there.
        problem: what is wrong with it.
        cure: what to do.
    """
    return ModelError(f"{where}: {field} is {shown(value)}: {problem}; {cure}")


def number(where: str, field: str, value: Any) -> float:
    """Return a finite float; strings, booleans, NaN and infinity are refused.

    Args:
        where: of the file, for messages.
        field: its name.
        value: what stands there.
    """
    if isinstance(value, str):
        raise refuse(where, field, value, "a number is written as text", "remove the quotes and the unit")
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise refuse(where, field, value, "not a number", "write one number")
    if not abs(value) <= LARGEST:
        # Not math.isfinite: it overflows on the huge integers that a file may hold.
        endless = isinstance(value, (float, np.floating)) and not np.isfinite(value)
        problem = "not a finite number" if endless else "beyond any vehicle"
        raise refuse(where, field, value, problem, "write the value in SI units")
    return float(value)


def numbers(where: str, field: str, value: Any, shape: tuple[int, ...]) -> Array:
    """Return a float64 array of the given shape (0 stands for any length) from nested lists.

    Args:
        where: of the file, for messages.
        field: its name.
        value: what stands there.
        shape: that it must have.
    """
    words = " x ".join(str(n) for n in shape) if shape != (0,) else "a list of"
    if isinstance(value, np.ndarray):
        value = value.tolist()

    def take(item: Any, remaining: tuple[int, ...], name: str) -> list[Any]:
        if not isinstance(item, (list, tuple)) or (remaining[0] and len(item) != remaining[0]):
            raise refuse(where, field, value, f"not {words} numbers", "write it as lists, like [0, 0, 0.05]")
        if len(item) > MAX_TABLE:
            raise refuse(where, field, value, f"longer than {MAX_TABLE}", "thin it out")
        if len(remaining) == 1:
            return [number(where, f"{name}[{i}]", x) for i, x in enumerate(item)]
        return [take(x, remaining[1:], f"{name}[{i}]") for i, x in enumerate(item)]

    return np.array(take(value, shape, field), dtype=np.float64)


class Fields:
    """The fields of one mapping, under the name by which messages call the place."""

    def __init__(self, data: Any, where: str, kind: str, known: Collection[str], also: Collection[str] = ()):
        """Refuse what is not a mapping, and keys that nobody knows."""
        if not isinstance(data, Mapping):
            raise ModelError(f"{where}: is {shown(data)}, not a mapping; write `key: value` pairs")
        for key in data:
            if key not in known and key not in also:
                raise ModelError(f"{where}: {unknown_name(f'{kind} key', shown_key(key), known)}")
        self.data = data
        self.where = where

    def has(self, key: str) -> bool:
        """Say whether a value is given; an empty one (null) is none."""
        return self.data.get(key) is not None

    def raw(self, key: str) -> Any:
        """Return a required value as it stands."""
        if not self.has(key):
            raise ModelError(f"{self.where}: {key} is missing; add a line `{key}: ...`")
        return self.data[key]

    def refuse(self, key: str, problem: str, cure: str) -> ModelError:
        """Return the error for one of these fields.

        Args:
            key: of the field.
            problem: what is wrong with it.
            cure: what to do.
        """
        return refuse(self.where, key, self.data.get(key), problem, cure)

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number; required where there is no default."""
        if default is not None and not self.has(key):
            return default
        return number(self.where, key, self.raw(key))

    def positive(self, key: str, default: float | None = None) -> float:
        """Return a positive number; required where there is no default."""
        value = self.number(key, default)
        if not value >= SMALLEST:
            raise self.refuse(key, "must be positive", "give its size in SI units, without a sign")
        return value

    def array(self, key: str, shape: tuple[int, ...]) -> Array:
        """Return a required array of finite numbers."""
        return numbers(self.where, key, self.raw(key), shape)

    def matrix(self, key: str, n: int) -> Array:
        """Return a required n x n matrix, given in full or by the n numbers of its diagonal."""
        value = self.raw(key)
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if isinstance(value, (list, tuple)) and not any(isinstance(row, (list, tuple)) for row in value):
            if len(value) != n:
                raise self.refuse(key, f"neither {n} x {n} nor {n} numbers", "write all rows or the diagonal")
            return np.diag(numbers(self.where, key, value, (n,)))
        return numbers(self.where, key, value, (n, n))

    def unit(self, key: str) -> Array:
        """Return a required direction as a unit vector."""
        vector = self.array(key, (3,))
        norm = float(np.linalg.norm(vector))
        if norm < 1e-9:
            raise self.refuse(key, "has no direction", "give a vector that is not zero, like [1, 0, 0]")
        # A vector that is a unit vector already stays as it is to the last bit, so files round-trip.
        return vector if abs(norm - 1.0) < 1e-12 else vector / norm

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text; required where there is no default."""
        if default is not None and not self.has(key):
            return default
        value = self.raw(key)
        if not isinstance(value, str):
            raise self.refuse(key, "not a text", "write it in quotes")
        return value

    def items(self, key: str) -> list[Any]:
        """Return a list, empty where none is given."""
        if not self.has(key):
            return []
        value = self.data[key]
        if not isinstance(value, (list, tuple)):
            raise self.refuse(key, "not a list", "start each entry with `- `")
        if len(value) > MAX_PARTS:
            raise self.refuse(key, f"has more than {MAX_PARTS} entries", "is this file a vehicle?")
        return list(value)


def shown_key(key: Any) -> str:
    """Return a key as it is shown in a message."""
    return shown(key).strip("'\"")
