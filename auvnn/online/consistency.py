"""Do the sensors agree with one another? A fault of one of them must not be learned as the vehicle's."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.online.residual import Sample
from auvnn.physics.attitude import quat_conjugate, quat_multiply, quat_to_matrix, quat_to_rotvec

Array = NDArray[np.float64]

OVER = 1.0  # s over which disagreement is summed up
SURE = 6.0  # standard deviations of the sum
# Mean disagreement that is never blamed on a sensor: turning rate against attitude (rad/s), velocity against
# position (m/s), velocity against accelerations (m/s2, rad/s2).
ALLOWED = np.array([0.02] * 3 + [0.05] * 3 + [0.15] * 6)
STUCK = 5  # samples of exactly the same value in one channel while others move
ROWS = 256


class Consistency:
    """Compares increments of attitude, position and velocity with the rates that the other sensors report.

    What is summed up over a second is the attitude's turn against p, q, r; the way, in body axes, against u, v, w
    (where there is a position); the gain of velocity against measured accelerations (where there are any). A sum
    is a fault when it exceeds six standard deviations of what its own sample-to-sample noise would make of it, and a
    stated allowance. A bias of a velocity sensor shows only where attitude, position or accelerations are there to
    contradict it.
    """

    def __init__(self) -> None:
        """Start with nothing."""
        self.forget()

    def forget(self) -> None:
        """Start again, as after a known jump of the vehicle's momentum."""
        self._rows: Array = np.zeros((0, 13))  # dt, then the disagreements
        self._stuck = np.zeros(6, dtype=np.int64)

    def faulty(self, last: Sample | None, sample: Sample) -> bool:
        """Take in a sample and say whether sensors contradict one another now."""
        if last is None:
            return False
        same = (sample.nu == last.nu).numpy()
        self._stuck = np.where(same & (sample.nu != 0).numpy(), self._stuck + 1, 0)
        dt = sample.t - last.t
        row = np.concatenate([[dt], self._disagreement(last, sample, dt)])
        rows = np.concatenate([self._rows, row[None]])[-ROWS:]
        age = np.cumsum(rows[::-1, 0])[::-1]
        self._rows = rows = rows[age <= OVER + dt]
        if len(rows) < 8:
            return False
        span = rows[:, 0].sum()
        there = ~np.isnan(rows[:, 1:]).any(axis=0)
        steps = np.sort(np.abs(np.diff(rows[:, 1:], axis=0)), axis=0)
        spread = 1.4826 / np.sqrt(2.0) * steps[len(steps) // 2]
        parts = rows[:, :1] * rows[:, 1:]
        # A command or a load that steps within an interval is one large part and no fault: the largest is left out.
        largest = np.take_along_axis(parts, np.nan_to_num(np.abs(parts)).argmax(axis=0)[None], axis=0)[0]
        mean = np.abs(parts.sum(axis=0) - largest) / span
        limit = SURE * spread / np.sqrt(len(rows)) + ALLOWED
        wrong = bool((mean[there] > limit[there]).any())
        return wrong or bool((self._stuck >= STUCK).any() and not same.all())

    def _disagreement(self, last: Sample, sample: Sample, dt: float) -> Array:
        turn = quat_to_rotvec(quat_multiply(quat_conjugate(last.eta[3:]), sample.eta[3:])) / dt
        middle = 0.5 * (last.nu + sample.nu)
        found = np.full(12, np.nan)
        found[:3] = (turn - middle[3:]).numpy()
        moved = sample.eta[:3] - last.eta[:3]
        # Positions that come more rarely than velocities stand still between two of them: `Positions` judges those.
        if bool((sample.eta[:3] != 0).any()) and bool((last.eta[:3] != 0).any()) and bool((moved != 0).any()):
            way = quat_to_matrix(last.eta[3:]).mT @ moved / dt
            # The body turns while it goes: half a turn's worth of the way, to first order.
            way = way - 0.5 * torch.linalg.cross(turn * dt, way)
            found[3:6] = (way - middle[:3]).numpy()
        if sample.nu_dot is not None and last.nu_dot is not None:
            found[6:] = ((sample.nu - last.nu) / dt - 0.5 * (last.nu_dot + sample.nu_dot)).numpy()
        return found

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        return {"rows": torch.tensor(self._rows), "stuck": torch.tensor(self._stuck)}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        self._rows, self._stuck = state["rows"].numpy().copy(), state["stuck"].numpy().copy()
