"""Code that was made before: remembered by what it was made from, and used again while that is as it was."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor

Code = TypeVar("Code")


def _nothing(dtype: torch.dtype) -> Tensor:
    return torch.zeros(0, dtype=dtype)


@dataclass
class Made(Generic[Code]):
    """What came of one model in one situation.

    Attributes:
        held: objects that the key names by identity: no others get their addresses meanwhile.
        code: None where none is possible.
        reason: why not, in words.
        fixed: places of the numbers that are part of the code.
        values: of those numbers.
        checked: versions of the code that were compared with torch.
    """

    held: list[Any]
    code: Code | None
    reason: str = ""
    fixed: Tensor = field(default_factory=lambda: _nothing(torch.int64))
    values: Tensor = field(default_factory=lambda: _nothing(torch.float64))
    checked: set[int] = field(default_factory=set)

    def holds(self, row: Tensor) -> bool:
        """Return whether the numbers that went into the code are what they were."""
        return torch.equal(row[self.fixed], self.values)


class KnownCode(Generic[Code]):
    """What was made for the last so many models and situations.

    Args:
        most: that are remembered; the oldest are forgotten.
    """

    def __init__(self, most: int) -> None:
        """Remember nothing yet."""
        self.most = most
        self._made: dict[Any, Made[Code]] = {}
        self._lock = Lock()

    def get(self, key: Any, row: Tensor, make: Callable[[], Made[Code]]) -> Made[Code]:
        """Return what was made, or what is made now.

        Args:
            key: of the model and the situation.
            row: the model's numbers.
            make: makes it.
        """
        made = self._made.get(key)
        if made is not None and made.holds(row):
            return made
        made = make()
        with self._lock:
            self._made.pop(key, None)
            self._made[key] = made
            while len(self._made) > self.most:
                self._made.pop(next(iter(self._made)))
        return made

    def clear(self) -> None:
        """Forget everything."""
        with self._lock:
            self._made.clear()

    def __len__(self) -> int:
        """Return how many are remembered."""
        return len(self._made)
