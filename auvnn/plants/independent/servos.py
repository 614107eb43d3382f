"""The fins' servos: angles as a function of continuous time, solved exactly between commands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Servos:
    """Fins whose angles chase what is commanded, tau d(angle)/dt = command - angle, from the first command on.

    Of propellers' speeds the same holds.

    Args:
        tau: time constant, s; at zero the angles are the commands.
    """

    def __init__(self, tau: float = 0.0) -> None:
        """Begin before the first command."""
        self.tau = tau
        # Per command: when it came, the command, and the angle at that moment.
        self.pieces: list[tuple[float, Array, Array]] = []

    def hold(self, angles: Array | None, begin: float) -> None:
        """Take commanded angles (R, m), rad, at a time, s; None where the vehicle is given none."""
        if angles is not None:
            self.pieces.append((begin, angles, self._at(begin) if self.pieces else angles))

    def _at(self, t: float) -> Array:
        begin, goal, first = self.pieces[-1]
        if self.tau <= 0.0:
            return goal
        return goal + (first - goal) * np.exp(-(t - begin) / self.tau)

    def now(self, t: float, angles: Array | None) -> Array | None:
        """Return the angles at a time of the last command's, (R, m); those given where nothing lags."""
        return self._at(t) if self.tau > 0.0 and self.pieces else angles

    def mean(self, begin: float, end: float) -> Array:
        """Return the mean angles over a stretch that lies after the first command, (R, m)."""
        total = np.zeros_like(self.pieces[0][1])
        last = end
        for start, goal, first in reversed(self.pieces):
            if last <= begin:
                break
            a, b, last = max(start, begin), min(last, end), start
            if b > a:
                total = total + (b - a) * goal
                if self.tau > 0.0:
                    left = np.exp(-(a - start) / self.tau) - np.exp(-(b - start) / self.tau)
                    total = total + self.tau * left * (first - goal)
        return total / (end - begin)
