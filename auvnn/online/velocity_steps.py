"""Does the measured velocity step as no force can make it? A sensor that fails does that; a changed vehicle does not."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.online.residual import Residual, Sample

Array = NDArray[np.float64]

KEPT, FEWEST = 50, 10
# A step is this many times the largest unexplained rate of the last samples, and this share of the velocity scale.
TIMES, SHARE = 4.0, 0.1
# Samples within which it shows that a step was a spike, or the beginning of a force; shares of the step for both.
SOON, BACK, GOES_ON = 3, 0.4, 0.5


class VelocitySteps:
    """Finds increments of the velocity that neither the model nor a measured acceleration explains.

    A force changes the acceleration, and the velocity only by its integral. A velocity that is another one from one
    sample to the next needs an impulse: a collision, or a sensor that began to report a bias or another scale. Whether
    it was a sensor shows when attitude and positions have had time to contradict it (`Consistency`, `Positions`). A
    spike goes back at once, and a sudden force goes on: both are left to the gate.

    Args:
        scale: velocity scale of the subnetworks, (6,), m/s and rad/s.
    """

    def __init__(self, scale: Tensor) -> None:
        """Start with nothing."""
        self.least = SHARE * scale.detach().numpy().astype(float)
        self.forget()

    def forget(self) -> None:
        """Start again: another run."""
        self._rates: Array = np.zeros((0, 6))
        self._first, self._sum, self._since = np.zeros(6), np.zeros(6), 0
        self._predicted: Array | None = None

    def judge(self, last: Sample, sample: Sample, found: Residual) -> bool | None:
        """Take in a sample.

        Args:
            last: the one before.
            sample: the newest.
            found: what the model leaves of it.

        Returns:
            True where the velocity steps, False where a step of the last samples turns out to be a spike or a force,
            None where nothing is to be said.
        """
        dt = sample.t - last.t
        rate = found.acceleration.numpy()
        if sample.nu_dot is not None:
            # What was found belongs to the moment, and the increment to the time since the last one.
            predicted = sample.nu_dot.numpy() - rate
            before = predicted if self._predicted is None else self._predicted
            rate, self._predicted = (sample.nu - last.nu).numpy() / dt - before, predicted
        ended = self._ended(rate * dt)
        known = len(self._rates) >= FEWEST
        usual = TIMES * self._rates.max(axis=0) if known else np.full(6, np.inf)
        steps = (np.abs(rate) > usual) & (np.abs(rate) * dt > self.least)
        # A step is no measure for the next one.
        kept = np.minimum(np.abs(rate), np.maximum(usual, self.least / dt))
        self._rates = np.concatenate([self._rates, kept[None]])[-KEPT:]
        if ended:
            return False
        if not steps.any() or self._since:
            return None
        self._first = np.where(steps, rate * dt, 0.0)
        self._sum, self._since = self._first.copy(), SOON
        return True

    def _ended(self, change: Array) -> bool:
        if not self._since:
            return False
        axis = int(np.abs(self._first).argmax())
        self._since -= 1
        self._sum = self._sum + change
        back = abs(self._sum[axis]) < BACK * abs(self._first[axis])
        force = change[axis] * np.sign(self._first[axis]) > GOES_ON * abs(self._first[axis])
        if back or force:
            self._since = 0
        return bool(back or force)

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        parts = {"rates": self._rates, "first": self._first, "sum": self._sum}
        if self._predicted is not None:
            parts["predicted"] = self._predicted
        return {**{k: torch.tensor(v) for k, v in parts.items()}, "since": torch.tensor(self._since)}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state; one that was saved before there was this test begins again."""
        if state:
            self._rates = state["rates"].numpy().copy()
            self._first, self._sum = state["first"].numpy().copy(), state["sum"].numpy().copy()
            self._since = int(state["since"])
            self._predicted = state["predicted"].numpy().copy() if "predicted" in state else None
