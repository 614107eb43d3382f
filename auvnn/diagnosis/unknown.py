"""What nobody can name: on which measured inputs the remaining residual depends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.locate import AXES
from auvnn.logs import Log
from auvnn.metrics.one_step import choose_derivative, one_step
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
FOLDS = 4
# Ridge, in units of the standardised features' variance: keeps collinear inputs from trading huge weights.
RIDGE = 1e-2
# Explained on held-out data, below which a dependence is not worth a word.
LEAST = 0.02


def inputs_of(log: Log) -> dict[str, list[Array]]:
    """Return the measured inputs that a residual may depend on, each (N,) by run."""
    found: dict[str, list[Array]] = {}
    for run in log.runs:
        columns = {n: run.nu[:, k] for k, n in enumerate("uvwpqr")}
        for k, n in enumerate(("phi", "theta", "psi")):
            columns[n] = run.euler[:, k]
        if run.command is not None:
            names = (
                [f"thruster_{i + 1}" for i in range(run.command.shape[1])]
                if run.thrusters is not None
                else [f"tau_{a}" for a in AXES]
            )
            columns.update({n: run.command[:, i] for i, n in enumerate(names)})
        if run.position is not None:
            columns.update({n: run.position[:, k] for k, n in enumerate("xyz")})
        for n in ("altitude", "voltage"):
            value = getattr(run, n)
            if value is not None:
                columns[n] = value
        if run.fins is not None:
            columns.update({f"fin_{i + 1}": run.fins[:, i] for i in range(run.fins.shape[1])})
        columns["t"] = run.t - run.t[0]
        for n, x in columns.items():
            found.setdefault(n, []).append(x)
    return found


def _features(name: str, x: Array) -> Array:
    if name in ("phi", "theta", "psi"):
        return np.stack([np.sin(x), np.cos(x), np.sin(2 * x), np.cos(2 * x)], axis=1)
    size = np.nanstd(x)
    z = x / size if size > 0 else x
    return np.stack([z, np.abs(z) * z, z * z, np.tanh(2 * z)], axis=1)


def depends_on(
    model: GreyBox, log: Log, windows: Windows, derivative: dict | None = None
) -> dict[str, dict[str, float]]:
    """Return by degree of freedom the share of the residual's energy that each measured input explains.

    A ridge regression on simple functions of every input is fitted on all folds but one and judged on that
    one. What it explains there is divided among the inputs by how much the held-out error grows when each
    one's values are exchanged between samples. Shares below one per cent are left out, and so is a degree of
    freedom of which the inputs together explain less than two.

    Reference: Breiman (2001), Machine Learning 45, for permutation importance.
    """
    del windows
    parts = one_step(model, log, choose_derivative(log, derivative))
    wrench = np.concatenate([p.wrench for p in parts])
    columns = {n: np.concatenate(x) for n, x in inputs_of(log).items()}
    columns = {n: x for n, x in columns.items() if np.isfinite(x).any() and np.nanstd(x) > 0}
    good = np.isfinite(wrench).all(1) & np.all([np.isfinite(x) for x in columns.values()], axis=0)
    if good.sum() < 200 or not columns:
        return {axis: {} for axis in AXES}
    blocks = {n: _features(n, x[good]) for n, x in columns.items()}
    x = np.concatenate(list(blocks.values()), axis=1)
    x = (x - x.mean(0)) / np.maximum(x.std(0), 1e-12)
    y = wrench[good]
    where, at = {}, 0
    for n, b in blocks.items():
        where[n] = slice(at, at + b.shape[1])
        at += b.shape[1]
    fold = np.arange(len(y)) * FOLDS // len(y)
    shuffle = np.random.default_rng(0)
    lost = {n: np.zeros(6) for n in blocks}
    total, left = np.zeros(6), np.zeros(6)
    for f in range(FOLDS):
        fit, out = fold != f, fold == f
        mean = y[fit].mean(0)
        gram = x[fit].T @ x[fit] + RIDGE * fit.sum() * np.eye(x.shape[1])
        weights = np.linalg.solve(gram, x[fit].T @ (y[fit] - mean))
        error = np.sum((y[out] - mean - x[out] @ weights) ** 2, axis=0)
        total += np.sum((y[out] - y[out].mean(0)) ** 2, axis=0)
        left += error
        for n, part in where.items():
            changed = x[out].copy()
            changed[:, part] = changed[shuffle.permutation(out.sum())][:, part]
            lost[n] += np.sum((y[out] - mean - changed @ weights) ** 2, axis=0) - error
    found: dict[str, dict[str, float]] = {}
    for k, axis in enumerate(AXES):
        explained = 1.0 - left[k] / total[k] if total[k] > 0 else 0.0
        weights = {n: max(float(v[k]), 0.0) for n, v in lost.items()}
        whole = sum(weights.values())
        if explained < LEAST or whole <= 0:
            found[axis] = {}
            continue
        shares = {n: explained * w / whole for n, w in weights.items()}
        found[axis] = dict(sorted(((n, v) for n, v in shares.items() if v >= 0.01), key=lambda i: -i[1]))
    return found
