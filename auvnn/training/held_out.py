"""How a model does one step ahead on pieces of a log: sums that are added in the order of the pieces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.executors import Executor
from auvnn.log_chunks.samples import Piece, inside, run_of
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.one_step import accelerations
from auvnn.models import GreyBox

Array = NDArray[np.float64]
NAMES = ("du", "dv", "dw", "dp", "dq", "dr")


@dataclass(frozen=True)
class Gaps:
    """Errors of one model, by acceleration.

    Attributes:
        count: samples, (6,).
        square: sum of the squared errors, (6,).
        mean: of what was measured, (6,).
        scatter: sum of squares about that mean, (6,).
    """

    count: Array
    square: Array
    mean: Array
    scatter: Array

    @classmethod
    def of(cls, measured: Array, predicted: Array) -> Gaps:
        """Return the sums over samples (N, 6); missing ones do not count."""
        good = np.isfinite(measured) & np.isfinite(predicted)
        count = good.sum(0).astype(float)
        seen = np.where(good, measured, 0.0)
        mean = seen.sum(0) / np.maximum(count, 1.0)
        gap = np.where(good, measured - predicted, 0.0)
        return cls(count, (gap**2).sum(0), mean, (np.where(good, seen - mean, 0.0) ** 2).sum(0))

    def __add__(self, other: Gaps) -> Gaps:
        """Return the sums over the samples of both (Chan, Golub and LeVeque 1979)."""
        count = self.count + other.count
        share = other.count / np.maximum(count, 1.0)
        apart = other.mean - self.mean
        return Gaps(
            count,
            self.square + other.square,
            self.mean + apart * share,
            self.scatter + other.scatter + apart**2 * self.count * share,
        )

    def scores(self) -> dict[str, dict[str, float]]:
        """Return rmse and R2 of each acceleration, as `metrics.one_step.scores` does."""
        with np.errstate(invalid="ignore", divide="ignore"):
            rmse = np.sqrt(self.square / np.where(self.count > 0, self.count, np.nan))
            r2 = 1.0 - self.square / np.where(self.scatter > 0, self.scatter, np.nan)
        return {n: {"rmse": float(a), "r2": float(b)} for n, a, b in zip(NAMES, rmse, r2, strict=True)}


@dataclass(frozen=True)
class _Asked:
    models: tuple[GreyBox, ...]
    derivative: Derivative
    mapping: Mapping


def _gaps(asked: _Asked, piece: Piece) -> tuple[Gaps, ...]:
    torch.set_num_threads(1)
    run = run_of(piece, asked.mapping)
    mine = inside(piece, run)
    pairs = [accelerations(model, run, asked.derivative) for model in asked.models]
    return tuple(Gaps.of(measured[mine], predicted[mine]) for measured, predicted in pairs)


def score(
    pool: Executor,
    pieces: Sequence[Piece],
    models: Sequence[GreyBox],
    derivative: Derivative,
    mapping: Mapping,
) -> list[dict[str, dict[str, float]]]:
    """Return rmse and R2 of each acceleration, for each model.

    Args:
        pool: who computes.
        pieces: at least one.
        models: at least one.
        derivative: how accelerations are obtained.
        mapping: of the columns.
    """
    total: list[Gaps] | None = None
    for found in pool.run(_gaps, _Asked(tuple(models), derivative, mapping), list(pieces)):
        total = list(found) if total is None else [a + b for a, b in zip(total, found, strict=True)]
    assert total is not None  # there is at least one piece
    return [gaps.scores() for gaps in total]
