"""A free run: where it went, and whether and why it diverged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from auvnn.cards import Card, Shown


@dataclass(frozen=True)
class Divergence:
    """Where a rollout left what is physical.

    Attributes:
        index: which trajectory, flattened.
        time: s, the last time at which the state was sound.
        term: the term of the equation of motion that pushed most, or "initial state".
        words: the same as a sentence.
    """

    index: int
    time: float
    term: str
    words: str


@dataclass(frozen=True, repr=False)
class Trajectory(Shown):
    """A free run.

    Attributes:
        times: (..., T), s.
        eta: (..., T, 7), NED m and quaternion.
        nu: (..., T, 6), m/s and rad/s.
        thrust: (..., T, n), N, just after each row's command.
        divergences: empty where the run stayed sound; a diverged trajectory holds its last sound state.
        fins: (..., T, m), rad, the actual fin angles just after each row's command, where an effect has them follow it or
            they change within an interval; else None.
        speeds: (..., T, n), the propellers' speed as the command that it settles at, its mean over each row, where an
            effect has it follow its command and another goes by it; else None.
        notes: in words, steps that were cut because the model is stiff, and velocities beyond those that the damping
            was trained on, where what it says is extrapolated.
    """

    times: Tensor
    eta: Tensor
    nu: Tensor
    thrust: Tensor
    divergences: tuple[Divergence, ...] = ()
    notes: tuple[str, ...] = ()
    fins: Tensor | None = None
    speeds: Tensor | None = None

    def card(self) -> Card:
        """Return how long the run is, how many there are, and whether they stayed sound."""
        shape, rows = tuple(self.nu.shape[:-2]), self.nu.shape[-2]
        span = float(self.times[..., -1].max() - self.times[..., 0].min()) if rows else 0.0
        many = f"{int(np.prod(shape))} runs of " if shape else ""
        sound = "no divergence" if not self.divergences else f"{len(self.divergences)} diverged"
        line = f"{many}{rows} rows over {span:.4g} s; {sound}"
        return Card("Trajectory", line, list(self.notes), foot=".times, .eta, .nu")

    @property
    def acting(self) -> Tensor:
        """What the actuators do as each row begins, for `GreyBox.nu_dot`: thrust, and fin angles and speeds that lag."""
        parts = [x for x in (self.thrust, self.fins, self.speeds) if x is not None]
        return torch.cat(parts, dim=-1) if len(parts) > 1 else self.thrust

    @property
    def diverged(self) -> bool:
        """Whether any trajectory left what is physical."""
        return bool(self.divergences)
