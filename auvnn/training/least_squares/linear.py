"""Forms that are linear in their coefficients: one least-squares solution, and what it cannot tell apart."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.damping.base import AXES
from auvnn.damping.polynomial import Polynomial

Array = NDArray[np.float64]
RANK_TOLERANCE = 1e-10
VELOCITIES = ("u", "v", "w", "p", "q", "r")


def triangles(form: Polynomial, nu: Tensor, targets: Tensor, weights: Tensor | None) -> Array:
    """Return what samples say about the coefficients: R of [columns, target] = Q R, (m, p + 1, p + 1).

    Args:
        form: the form whose coefficients are wanted.
        nu: scaled velocities (N, 6).
        targets: scaled damping (m, N), one row per axis of the form.
        weights: (m, N) of the squared residuals, or None for ones.
    """
    found = []
    for member in range(len(form.axes)):
        columns = np.concatenate(
            [form.regressors(nu, member).numpy(), targets[member].numpy()[:, None]], axis=1
        )
        if weights is not None:
            columns = columns * weights[member].sqrt().numpy()[:, None]
        found.append(_triangle(columns))
    return np.stack(found)


def merged(one: Array, other: Array) -> Array:
    """Return the triangles of the samples of both, as sums of squares would be added, but without squaring."""
    return np.stack([_triangle(np.concatenate(pair)) for pair in zip(one, other, strict=True)])


def solve_triangles(form: Polynomial, found: Array) -> tuple[Tensor, list[str]]:
    """Return the least-squares coefficients and a sentence for each thing the data cannot decide.

    Where coefficients cannot be told apart, the answer is the one of least norm.

    Args:
        form: the form whose coefficients are wanted.
        found: of all samples, as `triangles` gives them.

    Returns:
        Rows (m, p) in the order of the form's parameters (linear ones first), and the warnings.
    """
    rows: list[Tensor] = []
    doubts: dict[str, list[str]] = {}
    for axis, triangle in zip(form.axes, found, strict=True):
        columns, y = triangle[:, :-1], triangle[:, -1]
        size = np.linalg.norm(columns, axis=0)
        scaled = columns / np.where(size > 0, size, 1.0)
        solution = np.linalg.lstsq(scaled, y, rcond=RANK_TOLERANCE)[0]
        rows.append(torch.from_numpy(solution / np.where(size > 0, size, 1.0)))
        for doubt in _doubts(_names(form, axis), scaled):
            doubts.setdefault(doubt, []).append(AXES[axis])
    return torch.stack(rows), [f"{' '.join(axes)}: {doubt}" for doubt, axes in doubts.items()]


def _triangle(rows: Array) -> Array:
    triangle = np.zeros((rows.shape[1], rows.shape[1]))
    found = np.linalg.qr(rows, mode="r")
    triangle[: len(found)] = found
    return triangle


def _names(form: Polynomial, axis: int) -> list[str]:
    own = VELOCITIES if form.coupled else (VELOCITIES[axis],)
    return [*own, *(f"|{name}|{name}" for name in own)]


def _doubts(names: list[str], columns: np.ndarray) -> list[str]:
    """Say which coefficients cannot be known, or only in combination (correlation beyond 0.99)."""
    absent = [name for name, column in zip(names, columns.T, strict=True) if not np.any(column)]
    if absent:
        return [f"no motion in {', '.join(absent)}: their coefficients are set to zero, not measured"]
    _, singular, directions = np.linalg.svd(np.linalg.qr(columns, mode="r"))
    singular = np.concatenate([singular, np.zeros(len(names) - len(singular))])
    rank = int(np.sum(singular > RANK_TOLERANCE * singular[0]))
    if rank < len(names):
        loose = [n for n, part in zip(names, np.abs(directions[rank:]).max(0), strict=True) if part > 0.1]
        return [
            f"the coefficients of {', '.join(loose)} cannot be told apart on this data "
            f"(rank {rank} of {len(names)}): only their combination is known"
        ]
    covariance = (directions.T / singular**2) @ directions
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    pairs = [(i, j) for i in range(len(names)) for j in range(i) if abs(correlation[i, j]) > 0.99]
    return [
        f"the coefficients of {names[j]} and {names[i]} are correlated by {correlation[i, j]:.3f}: "
        "only their combination is well known"
        for i, j in pairs
    ]
