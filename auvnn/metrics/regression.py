"""A plain linear regression of the acceleration, free running: what a grey-box model has to beat.

    nu_dot = B [nu, |nu| nu, command, (fin angles), R^T e_z, 1]

Least squares, no physics and no prior: six rows of one matrix B. Where accelerations are estimated by a filter, the
regressors pass the same filter. Reference: Klein and Morelli (2006), Aircraft System Identification, section 5.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Log, Run
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.logs.signals.rotation import conjugate, rotate
from auvnn.metrics.derivative import Derivative, integrated
from auvnn.metrics.folds import Folds
from auvnn.metrics.rollouts import NAMES, Rolled, Scale, scored
from auvnn.metrics.windows import Windows, commands

Array = NDArray[np.float64]
# Directions of the regressors of which the log says less than this, beside the best known one, are left alone.
SEEN = 1e-12
DOWN = np.array([0.0, 0.0, 1.0])
# Beyond these speeds, m/s and rad/s, a free run has left what is physical.
LIMIT = 1e3


def regressors(nu: Array, command: Array, fins: Array | None, down: Array) -> Array:
    """Return velocities, |velocity| velocity, commands, fin angles, the direction of gravity in the body, and one.

    Args:
        nu: velocities, (..., 6), m/s and rad/s.
        command: (..., n).
        fins: fin angles, rad, (..., m), or None.
        down: direction of gravity in body axes, (..., 3).
    """
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


Sums = tuple[Array, Array]


def _sums(run: Run, kind: str, fins: bool, how: Derivative, folds: Folds) -> dict[int, Sums]:
    """Return the normal equations of a run by fold: (c, c) of the regressors, (c, 6) of them and the accelerations."""
    rows, measured = _rows(run, kind, fins, how)
    good = np.isfinite(rows).all(1) & np.isfinite(measured).all(1)
    own, found = folds.at(run.number, run.t), {}
    for fold in np.unique(own):
        x, y = rows[good & (own == fold)], measured[good & (own == fold)]
        found[int(fold)] = (x.T @ x, x.T @ y)
    return found


def _solved(sums: Sequence[Sums]) -> Array:
    """Return B, (6, c), by least squares; zero in directions that nothing shows."""
    gram, right = np.sum([s[0] for s in sums], axis=0), np.sum([s[1] for s in sums], axis=0)
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
    """The regression fitted to a log, once to everything and once without each fold.

    Attributes:
        fins: whether fin angles are among the regressors.
        whole: (6, c), fitted to everything.
        without: fold to (6, c), fitted to the others; empty where there is one fold only.
        folds: what is left out in turn.
    """

    fins: bool
    whole: Array
    without: dict[int, Array]
    folds: Folds

    @classmethod
    def of(cls, log: Log, kind: str, how: Derivative, folds: Folds | None = None) -> Regression:
        """Fit it to a log.

        Args:
            log: measurements.
            kind: which commands drive it, "thrusters" or "wrench".
            how: how accelerations are obtained.
            folds: what to leave out in turn; `Folds.of(log)` by default.

        Raises:
            InputError: a run lacks the commands.
        """
        folds = folds or Folds.of(log)
        fins = all(run.fins is not None for run in log.runs)
        parts = [(f, s) for run in log.runs for f, s in _sums(run, kind, fins, how, folds).items()]
        without = {
            f: _solved([s for g, s in parts if g != f]) for f in folds.numbers if len(folds.numbers) > 1
        }
        return cls(fins, _solved([s for _, s in parts]), without, folds)

    def predict(self, windows: Windows, *, left_out: bool, max_step: float | None = None) -> Array:
        """Run every window free from its measured start and return velocities, (B, L, 6); NaN once one has run away.

        Args:
            windows: of the log that was fitted, or of another.
            left_out: the windows are of the fitted log: each is run with coefficients that have not seen its fold.
            max_step: longest step of the solver, s; the windows' own by default.
        """
        coefficients = np.broadcast_to(self.whole, (len(windows), *self.whole.shape)).copy()
        if left_out and self.without:
            fold, _ = self.folds.windows(windows)
            for k, value in self.without.items():
                coefficients[fold == k] = value
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


def baseline(found: Regression, like: Rolled, scale: Scale, *, left_out: bool) -> dict[str, Any]:
    """Return the errors of the regression over the windows of a free run, and those of persistence.

    Args:
        found: the regression.
        like: a free run of a model over the windows wanted.
        scale: what errors are measured by.
        left_out: the windows are of the fitted log: each is run with coefficients that have not seen its fold.

    Returns:
        `total` and one entry for each velocity (NaN where it is not excited), `diverged`, and `persistence` with `total`
        and the same entries.
    """
    ran = scored(like.windows, found.predict(like.windows, left_out=left_out), scale)
    out: dict[str, Any] = {"total": ran.total(scale), **_by_name(ran.nrmse(scale))}
    out["diverged"] = int(ran.diverged.sum())
    out["persistence"] = {"total": like.total(scale, held=True), **_by_name(like.nrmse(scale, held=True))}
    return out


def _by_name(values: Array) -> dict[str, float]:
    return {n: float(v) for n, v in zip(NAMES, values, strict=True)}


def worse_than(mine: Mapping[str, float], line: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the excited velocities in which a model errs more than the regression, and more than persistence.

    Args:
        mine: the model's errors by velocity.
        line: what `baseline` returns.
    """
    out: dict[str, list[str]] = {"baseline": [], "persistence": []}
    for name in NAMES:
        error = mine.get(name, float("nan"))
        for key, other in (("baseline", line[name]), ("persistence", line["persistence"][name])):
            if np.isfinite(other) and np.isfinite(error) and error > other:
                out[key].append(name)
    return out
