"""How noisy the residual is, and whether one residual is too sudden to be believed."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

KEPT = 50
# From the median of absolute differences of neighbours to the standard deviation of one.
TO_STD = 1.4826 / np.sqrt(2.0)


class NoiseLevel:
    """Robust standard deviation of a residual, from differences of neighbours over the last samples.

    Differences leave out what changes slowly, so that a model that is wrong does not pass for noise; the median
    leaves out single spikes.

    Args:
        floor: least standard deviation.
    """

    def __init__(self, floor: float) -> None:
        """Start with nothing."""
        self.floor = floor
        self._ring: NDArray[np.float64] = np.zeros((0, 6))

    @property
    def count(self) -> int:
        """Number of residuals kept."""
        return len(self._ring)

    def add(self, residual: Tensor) -> None:
        """Take in a residual (6,)."""
        self._ring = np.concatenate([self._ring, residual.numpy()[None]])[-KEPT:]

    def std(self) -> NDArray[np.float64]:
        """Return the standard deviation (6,), at least the floor."""
        if len(self._ring) < 3:
            return np.full(6, self.floor)
        steps = np.sort(np.abs(np.diff(self._ring, axis=0)), axis=0)
        spread = 0.5 * (steps[(len(steps) - 1) // 2] + steps[len(steps) // 2])
        return np.maximum(TO_STD * spread, self.floor)

    def forget(self) -> None:
        """Start again."""
        self._ring = np.zeros((0, 6))

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        return {"ring": torch.tensor(self._ring)}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        self._ring = state["ring"].numpy().copy()


class Gate:
    """Holds back residuals that are too sudden, until they have lasted.

    Args:
        width: standard deviations.
        floor: least standard deviation assumed.
        persist: s for which a sudden residual must last, to one side, before it is believed.
    """

    def __init__(self, width: float, floor: float, persist: float) -> None:
        """Start open."""
        self.width, self.floor, self.persist = width, floor, persist
        self.since: float | None = None
        self.axis, self.sign, self.seen = 0, 0.0, 0

    def holds(self, t: float, error: Tensor, std: NDArray[np.float64]) -> tuple[bool, bool]:
        """Return whether the residual is held back, and whether a sudden one is believed just now.

        Args:
            t: s.
            error: scaled residual, (6,).
            std: its usual standard deviation, (6,).
        """
        ratio = error.numpy() / np.maximum(std, self.floor)
        axis = int(np.argmax(np.abs(ratio)))
        if abs(ratio[axis]) <= self.width:
            self.clear()
            return False, False
        sign = float(np.sign(ratio[axis]))
        if self.since is None or (axis == self.axis and sign != self.sign):
            # Noise that jumps from side to side is no change of the vehicle.
            self.since, self.seen = t, 0
        self.axis, self.sign, self.seen = axis, sign, self.seen + 1
        if t - self.since >= self.persist and self.seen >= 4:
            self.clear()
            return False, True
        return True, False

    def clear(self) -> None:
        """Open again."""
        self.since, self.seen = None, 0

    def state(self) -> dict[str, float]:
        """Return what is remembered as plain data."""
        since = None if self.since is None else float(self.since)
        return {"since": since, "axis": self.axis, "sign": self.sign, "seen": self.seen}  # type: ignore[dict-item]

    def load(self, state: Mapping[str, float]) -> None:
        """Take up a state."""
        self.since, self.axis = state["since"], int(state["axis"])
        self.sign, self.seen = float(state["sign"]), int(state["seen"])
