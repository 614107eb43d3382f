"""The velocities that damping was learned from: beyond them it says something, but nobody knows whether it is true."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from auvnn.errors import ModelError

# Share of the region's width by which a velocity may leave it before that is worth a word.
MARGIN = 0.1
NAMES = ("u", "v", "w", "p", "q", "r")


@dataclass(frozen=True)
class Region:
    """A box of velocities through the water.

    Args:
        low: smallest [u v w p q r] seen in training, m/s and rad/s.
        high: largest.
    """

    low: tuple[float, ...]
    high: tuple[float, ...]

    @classmethod
    def of(cls, nu: Tensor) -> Region | None:
        """Return the region that samples (N, 6) fill, None where there are none."""
        good = nu[torch.isfinite(nu).all(-1)].detach().double()
        if not len(good):
            return None
        return cls(tuple(good.amin(0).tolist()), tuple(good.amax(0).tolist()))

    @classmethod
    def read(cls, data: Any, where: str) -> Region:
        """Read `{low: six numbers, high: six numbers}`.

        Raises:
            ModelError: it is something else.
        """
        if isinstance(data, Mapping) and set(data) == {"low", "high"}:
            low, high = _six(data["low"]), _six(data["high"])
            if low and high and all(a <= b for a, b in zip(low, high, strict=True)):
                return cls(low, high)
        raise ModelError(
            f"{where}: trained_region must hold low and high, six numbers each: save the model again"
        )

    def to_dict(self) -> dict[str, list[float]]:
        """Return plain data for `model.yaml`."""
        return {"low": list(self.low), "high": list(self.high)}

    def outside(self, nu: Tensor) -> Tensor:
        """Return which velocities (..., 6) lie beyond the region and its margin; missing ones do not."""
        low, high = (torch.tensor(x, dtype=nu.dtype, device=nu.device) for x in (self.low, self.high))
        room = MARGIN * (high - low)
        return (nu < low - room) | (nu > high + room)

    def words(self, nu: Tensor) -> str:
        """Say which velocities (N, 6) leave the region, how often and how far; "" where none does."""
        flat = nu.reshape(-1, 6)
        beyond = self.outside(flat)
        parts = []
        for i, name in enumerate(NAMES):
            if beyond[:, i].any():
                values = flat[beyond[:, i], i]
                worst = float(values[values.abs().argmax()])
                unit = "m/s" if i < 3 else "rad/s"
                share = 100.0 * float(beyond[:, i].double().mean())
                seen = f"{self.low[i]:.3g} to {self.high[i]:.3g}"
                parts.append(f"{name} {worst:.3g} {unit} against {seen} ({share:.2g} % of the samples)")
        return ", ".join(parts)


def _six(value: Any) -> tuple[float, ...]:
    if not isinstance(value, Sequence) or isinstance(value, str) or len(value) != 6:
        return ()
    good = all(isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x) for x in value)
    return tuple(float(x) for x in value) if good else ()
