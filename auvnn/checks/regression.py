"""Accelerations of a log as a linear regression: what drives the vehicle, apart from what resists or pulls.

Both sides pass the same filter, as in one-step residuals. Drag, restoring and constant forces are nuisance: they are
fitted along and never believed, so that a model whose coefficients are guesses does not turn into a verdict on its
thrusters. Errors are correlated in time; how much is taken from the residuals themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.logs import Log, Run
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.logs.signals.rotation import conjugate, rotate
from auvnn.metrics.derivative import Derivative, choose_derivative, integrated
from auvnn.metrics.one_step import accelerations
from auvnn.models import GreyBox

Array = NDArray[np.float64]
_LONG = 40_000  # samples: more are thinned to blocks by leaving runs' ends out
_LAGS_SECONDS = 5.0


@dataclass(frozen=True)
class RegressionRows:
    """Samples of a log for a regression.

    Args:
        gap: measured minus the model's acceleration, (N, 6).
        nuisance: what is fitted along, (N, m).
        thrust: settled thrust of each actuator through the same filter, N, (N, n); zero where it is not needed.
        rotation: (N, 3, 3), body to world.
        run: (N,) number of the run.
        dt: median step, s.
    """

    gap: Array
    nuisance: Array
    thrust: Array
    rotation: Array
    run: Array
    dt: float


def regression_rows(model: GreyBox, log: Log, derivative: Derivative | None = None) -> RegressionRows:
    """Return a log's samples for a regression.

    Args:
        model: the model.
        log: the log; it must have the commands that drive the model.
        derivative: how accelerations are obtained; as the log has them by default.
    """
    how = derivative or choose_derivative(log)
    parts = []
    left = _LONG
    for run in log.runs:
        if left <= 0:
            break
        run = run if run.samples <= left else run.cut(slice(0, left))
        left -= run.samples
        parts.append(_of_run(model, run, how))
    gap, nuisance, thrust, rotation, number = (np.concatenate(p) for p in zip(*parts, strict=True))
    return RegressionRows(gap, nuisance, thrust, rotation, number, float(np.median([r.dt for r in log.runs])))


def _of_run(model: GreyBox, run: Run, how: Derivative) -> tuple[Array, Array, Array, Array, Array]:
    measured, predicted = accelerations(model, run, how)
    command = run.thrusters if model.actuation == "thrusters" else run.wrench
    assert command is not None  # accelerations() has refused a run without
    with torch.no_grad():
        effects = [e for e in model.before_thrust if "delay" not in e.hooks()]
        times, held = torch.tensor(run.t), torch.tensor(np.nan_to_num(command))
        thrust = model.actuators.drive(held, times, effects).starts.numpy()
    down = rotate(conjugate(run.quaternion), np.broadcast_to([0.0, 0.0, 1.0], (run.samples, 3)))
    nu = run.nu
    velocity = np.concatenate([nu, np.abs(nu) * nu], axis=1)
    products = np.stack([nu[:, i] * nu[:, j] for i in range(6) for j in range(i)], axis=1)
    beside = np.concatenate([velocity, products, down, np.ones((run.samples, 1))], axis=1)
    signals = np.concatenate([thrust, beside], axis=1)
    if how.method != "measured":
        smooth = LocalPolynomial(run.t, how.half_width, how.order)
        signals = smooth(integrated(run.t, np.where(np.isfinite(signals), signals, np.nan)))[1]
    good = (
        np.isfinite(measured - predicted).all(1) & np.isfinite(signals).all(1) & np.isfinite(command).all(1)
    )
    n = thrust.shape[1]
    w, x, y, z = run.quaternion[good].T
    rotation = np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        axis=-2,
    )
    number = np.full(int(good.sum()), run.number)
    return (measured - predicted)[good], signals[good, n:], signals[good, :n], rotation, number


def without(beside: Array, x: Array) -> Array:
    """Return x with the part taken out that is a linear combination of `beside`."""
    scale = np.sqrt((beside**2).mean(0))
    columns = beside[:, scale > 1e-12] / scale[scale > 1e-12]
    return x - columns @ np.linalg.lstsq(columns, x, rcond=1e-10)[0]


def variance_inflation(rows_of: RegressionRows, residual: Array, regressor: Array) -> float:
    """Return by how much correlation in time multiplies the variance of a regression's coefficients.

    1 + 2 sum_k r_k s_k with the autocorrelations of residual and regressors, Bartlett's window over 5 s, and the
    worst of the columns, not less than one.

    Args:
        rows_of: the regression, for its time step `dt`, s.
        residual: what the regression leaves, (N, outputs).
        regressor: its columns, (N, columns).
    """
    lags = int(min(_LAGS_SECONDS / rows_of.dt, len(residual) / 4))
    a, b = _autocorrelation(residual, lags), _autocorrelation(regressor, lags)
    window = 1.0 - np.arange(1, lags + 1) / (lags + 1)
    return float(max(1.0, (1.0 + 2.0 * (window[:, None, None] * a[:, :, None] * b[:, None, :]).sum(0)).max()))


def _autocorrelation(x: Array, lags: int) -> Array:
    """Return the autocorrelation at 1 ... lags of each column, (lags, k)."""
    size = 1 << int(np.ceil(np.log2(2 * len(x))))
    spectrum = np.fft.rfft(x - x.mean(0), size, axis=0)
    raw = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[: lags + 1]
    return raw[1:] / np.maximum(raw[:1], 1e-300)
