"""A plain linear regression of the acceleration, free running: what a grey-box model has to beat.

    nu_dot = B [nu, |nu| nu, command, (fin angles), R^T e_z, 1]

Least squares, no physics and no prior: six rows of one matrix B. Where accelerations are estimated by a filter, the
regressors pass the same filter. Reference: Klein and Morelli (2006), Aircraft System Identification, section 5.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Log, Run
from auvnn.logs.derivatives import LocalPolynomial
from auvnn.logs.rotation import conjugate, rotate
from auvnn.metrics.one_step import Derivative, integrated
from auvnn.metrics.windows import Windows, commands

Array = NDArray[np.float64]
# Directions of the regressors of which the log says less than this, beside the best known one, are left alone.
SEEN = 1e-8
# A run is left out whole, a single run by so many stretches.
STRETCHES = 5
DOWN = np.array([0.0, 0.0, 1.0])
# Beyond these speeds, m/s and rad/s, a free run has left what is physical.
LIMIT = 1e3


@dataclass(frozen=True)
class Sums:
    """Normal equations of one stretch of a log.

    Attributes:
        run: number of its run.
        first: its first sample in the run.
        stop: the sample after its last.
        gram: (c, c) of the regressors.
        right: (c, 6) of regressors and accelerations.
    """

    run: int
    first: int
    stop: int
    gram: Array
    right: Array


def regressors(nu: Array, command: Array, fins: Array | None, down: Array) -> Array:
    """Return velocities, |velocity| velocity, commands, fin angles, the direction of gravity in the body, and one."""
    parts = [nu, np.abs(nu) * nu, command, *([] if fins is None else [fins]), down]
    lead = nu.shape[:-1]
    return np.concatenate([*parts, np.ones((*lead, 1))], axis=-1)


def _rows(run: Run, kind: str, fins: bool, how: Derivative) -> tuple[Array, Array]:
    """Return regressors (N, c) and accelerations (N, 6) of a run, NaN where something is missing."""
    command, _ = commands(run, kind)
    run = run.cleaned
    down = rotate(conjugate(run.quaternion), np.broadcast_to(DOWN, (run.samples, 3)))
    velocity = np.where(run.valid[:, None], run.nu, np.nan)
    rows = regressors(velocity, command, run.fins if fins else None, down)
    if how.method == "measured":
        assert run.nu_dot is not None  # whoever chose the method has seen to that
        return rows, run.nu_dot
    smooth = LocalPolynomial(run.t, how.half_width, how.order)
    # The filter's slope of the integral: a command that is held over its interval counts for the whole of it.
    return smooth(integrated(run.t, rows))[1], smooth(velocity)[1]


def _sums(run: Run, kind: str, fins: bool, how: Derivative, parts: int) -> list[Sums]:
    rows, measured = _rows(run, kind, fins, how)
    edges = np.linspace(0, run.samples, parts + 1).astype(int)
    found = []
    for first, stop in zip(edges[:-1], edges[1:], strict=True):
        x, y = rows[first:stop], measured[first:stop]
        good = np.isfinite(x).all(1) & np.isfinite(y).all(1)
        x, y = x[good], y[good]
        found.append(Sums(run.number, int(first), int(stop), x.T @ x, x.T @ y))
    return found


def solved(sums: list[Sums]) -> Array:
    """Return B, (6, c), by least squares over stretches; zero in directions that they do not show."""
    gram, right = np.sum([s.gram for s in sums], axis=0), np.sum([s.right for s in sums], axis=0)
    size = np.sqrt(np.diag(gram))
    known = size > 1e-12
    out = np.zeros((6, len(size)))
    if known.any():
        unit = size[known]
        scaled = gram[np.ix_(known, known)] / unit[:, None] / unit
        out[:, known] = (
            np.linalg.pinv(scaled, SEEN, hermitian=True) @ (right[known] / unit[:, None])
        ).T / unit
    return out


@dataclass(frozen=True)
class Regression:
    """The regression fitted to a log: coefficients for every stretch that may be left out, and for none.

    Attributes:
        kind: which commands drive it, "thrusters" or "wrench".
        fins: whether fin angles are among the regressors.
        whole: (6, c), fitted to everything.
        without: {(run, first sample, sample after the last): (6, c) fitted to the rest}.
    """

    kind: str
    fins: bool
    whole: Array
    without: Mapping[tuple[int, int, int], Array]

    @classmethod
    def of(cls, log: Log, kind: str, how: Derivative) -> Regression:
        """Fit it to a log, once to everything and once for every run left out, or fifth of a single run.

        Args:
            log: measurements.
            kind: which commands to take.
            how: how accelerations are obtained.

        Raises:
            InputError: a run lacks the commands.
        """
        fins = all(run.fins is not None for run in log.runs)
        parts = STRETCHES if len(log.runs) == 1 else 1
        sums = [s for run in log.runs for s in _sums(run, kind, fins, how, parts)]
        without = {
            (s.run, s.first, s.stop): solved([other for other in sums if other is not s])
            for s in sums
            if len(sums) > 1
        }
        return cls(kind, fins, solved(sums), without)

    def predict(self, windows: Windows, *, left_out: bool, max_step: float | None = None) -> Array:
        """Run every window free from its measured start and return velocities, (B, L, 6); NaN once one has run away.

        Args:
            windows: of the log that was fitted, or of another.
            left_out: the windows are of the fitted log: each is run with coefficients that have not seen its run.
            max_step: longest step of the solver, s; the windows' own by default.
        """
        coefficients = np.broadcast_to(self.whole, (len(windows), *self.whole.shape)).copy()
        if left_out:
            middle = windows.first + windows.length // 2
            for (run, first, stop), value in self.without.items():
                mine = (windows.run == run) & (middle >= first) & (middle < stop)
                coefficients[mine] = value
        return _free_run(coefficients, windows, self.fins, windows.max_step if max_step is None else max_step)


def _free_run(coefficients: Array, windows: Windows, fins: bool, max_step: float) -> Array:
    """Integrate attitude and velocity by Runge and Kutta's method of fourth order, commands held between samples."""
    w = windows.warmup
    times = windows.times[:, w:].numpy()
    command = windows.inputs.command[:, w:].numpy()
    angles = windows.inputs.fins[:, w:].numpy() if fins and windows.inputs.fins is not None else None
    quaternion, nu = windows.eta[:, 0, 3:].numpy().copy(), windows.nu[:, 0].numpy().copy()
    out = np.empty((*times.shape, 6))
    out[:, 0] = nu

    def rate(q: Array, v: Array, k: int) -> tuple[Array, Array]:
        down = np.stack(
            [
                2 * (q[:, 1] * q[:, 3] - q[:, 0] * q[:, 2]),
                2 * (q[:, 2] * q[:, 3] + q[:, 0] * q[:, 1]),
                1 - 2 * (q[:, 1] ** 2 + q[:, 2] ** 2),
            ],
            axis=-1,
        )
        x = regressors(v, command[:, k], None if angles is None else angles[:, k], down)
        p, s = v[:, 3:], q[:, :1]
        turn = 0.5 * np.concatenate(
            [-(q[:, 1:] * p).sum(1, keepdims=True), s * p + np.cross(q[:, 1:], p)], axis=1
        )
        return turn, np.einsum("bic,bc->bi", coefficients, x)

    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(times.shape[1] - 1):
            span = times[:, k + 1] - times[:, k]
            count = max(1, int(np.ceil(float(span.max()) / max_step - 1e-9)))
            h = (span / count)[:, None]
            for _ in range(count):
                q1, v1 = rate(quaternion, nu, k)
                q2, v2 = rate(quaternion + 0.5 * h * q1, nu + 0.5 * h * v1, k)
                q3, v3 = rate(quaternion + 0.5 * h * q2, nu + 0.5 * h * v2, k)
                q4, v4 = rate(quaternion + h * q3, nu + h * v3, k)
                quaternion = quaternion + h / 6 * (q1 + 2 * q2 + 2 * q3 + q4)
                quaternion = quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)
                nu = nu + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
                # What has run away stays away: it is cut by whoever scores it.
                nu = np.where((np.abs(nu) < LIMIT).all(1, keepdims=True), nu, np.nan)
            out[:, k + 1] = nu
    return out
