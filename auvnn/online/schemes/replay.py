"""Learning from the present sample together with remembered ones, kept for the variety of their velocities."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from auvnn.damping.base import positive_int
from auvnn.online.schemes.base import Observation, OnlineScheme, number
from auvnn.online.updates.weights import Weights

# How exactly the damping vanishes at rest, of the force scale.
REST = 0.01


class ExperienceReplay(OnlineScheme):
    """A regularised projection onto the present sample and a batch of remembered ones, all weights at once.

    w <- w + rate J' (J J' + diag(R / n + c |J|^2))^-1 e   over the batch, each degree of freedom for itself

    The memory holds cells of velocity: a sample that falls near one joins its running mean (n samples of it, so
    noise averages out), a new one takes a separate cell, and where the memory is full the two nearest cells
    make room by merging. What the vehicle did once is therefore not forgotten while it does something else.
    A change of the vehicle empties the memory, because old targets are wrong then.

    Args:
        learning_rate: share of the projection that is taken, 0 to 1.
        memory: cells.
        batch: cells used with the present sample, in turn.
        near: samples within this distance, in the velocity scale, share a cell.
        most: samples that a cell's mean counts as at most; later ones then push the older out.
        ridge: c, which keeps the step small where the batch hardly tells the weights apart.
    """

    name = "replay"

    def __init__(
        self,
        *,
        learning_rate: float = 0.1,
        memory: int = 64,
        batch: int = 8,
        near: float = 0.1,
        most: int = 200,
        ridge: float = 0.01,
    ) -> None:
        """Check the options."""
        self.learning_rate = number(learning_rate, "learning_rate", 0.0, 1.0)
        self.memory = positive_int(memory, "online option 'memory'")
        self.batch = positive_int(batch, "online option 'batch'", most=64)
        self.near = number(near, "near", 0.0, 10.0)
        self.most = positive_int(most, "online option 'most'", most=1_000_000)
        self.ridge = number(ridge, "ridge", 1e-9, 10.0)
        self._empty()

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        names = ("learning_rate", "memory", "batch", "near", "most", "ridge")
        return {name: getattr(self, name) for name in names}

    def _empty(self) -> None:
        self._nu = torch.zeros(0, 6, dtype=torch.float64)
        self._target = torch.zeros(0, 6, dtype=torch.float64)
        self._count = torch.zeros(0, dtype=torch.float64)
        self._turn = 0

    def changed(self) -> None:
        """Empty the memory: its targets belong to the vehicle as it was."""
        self._empty()

    def propose(self, weights: Weights, observation: Observation) -> Tensor:
        """Return the weights after one projection."""
        rows = self._drawn()
        slopes, errors = observation.slope[None], observation.error[None]
        variance = observation.variance[None]
        if len(rows):
            values, more = weights.jacobians(self._nu[rows])
            slopes = torch.cat([slopes, more])
            errors = torch.cat([errors, self._target[rows] - values])
            variance = torch.cat([variance, observation.variance / self._count[rows, None]])
        # Damping vanishes at rest: this is known beforehand and never leaves the batch.
        still, more = weights.jacobians(torch.zeros(1, 6, dtype=slopes.dtype))
        slopes, errors = torch.cat([slopes, more]), torch.cat([errors, -still])
        variance = torch.cat([variance, torch.full_like(still, REST**2)])
        gram = torch.einsum("map,nap->amn", slopes, slopes)
        size = gram.diagonal(dim1=-2, dim2=-1).mean(-1, keepdim=True)
        gram = gram + torch.diag_embed(variance.T + self.ridge * size + 1e-12)
        solved = torch.linalg.solve(gram, errors.T[:, :, None])[..., 0]
        self._keep(observation, weights.bank.input_scale)
        return weights.read() + self.learning_rate * torch.einsum("am,map->ap", solved, slopes)

    def _drawn(self) -> Tensor:
        """Return the cells whose turn it is."""
        cells = len(self._nu)
        if cells == 0:
            return torch.zeros(0, dtype=torch.int64)
        rows = (self._turn + torch.arange(min(self.batch, cells))) % cells
        self._turn = int(rows[-1] + 1) % cells
        return rows

    def _keep(self, observation: Observation, scale: Tensor) -> None:
        if len(self._nu):
            apart = ((self._nu - observation.nu) / scale).square().sum(1)
            nearest = int(apart.argmin())
            if float(apart[nearest]) < self.near**2:
                self._join(nearest, observation.nu, observation.target, 1.0)
                return
        self._nu = torch.cat([self._nu, observation.nu[None]])
        self._target = torch.cat([self._target, observation.target[None]])
        self._count = torch.cat([self._count, self._count.new_ones(1)])
        if len(self._nu) > self.memory:
            self._merge(scale)

    def _join(self, cell: int, nu: Tensor, target: Tensor, count: float) -> None:
        share = count / (float(self._count[cell]) + count)
        self._nu, self._target, self._count = self._nu.clone(), self._target.clone(), self._count.clone()
        self._nu[cell] += share * (nu - self._nu[cell])
        self._target[cell] += share * (target - self._target[cell])
        self._count[cell] = min(float(self._count[cell]) + count, float(self.most))

    def _merge(self, scale: Tensor) -> None:
        """Merge the two nearest cells: variety is what the memory is for."""
        apart = torch.cdist(self._nu / scale, self._nu / scale)
        apart.fill_diagonal_(torch.inf)
        first, second = divmod(int(apart.argmin()), len(apart))
        first, second = min(first, second), max(first, second)
        self._join(first, self._nu[second], self._target[second], float(self._count[second]))
        kept = [k for k in range(len(self._nu)) if k != second]
        self._nu, self._target, self._count = self._nu[kept], self._target[kept], self._count[kept]
        self._turn %= len(kept)

    def state(self) -> dict[str, Tensor]:
        """Return the memory."""
        return {
            "nu": self._nu,
            "target": self._target,
            "count": self._count,
            "turn": torch.tensor(self._turn, dtype=torch.int64),
        }

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a memory."""
        self._nu, self._target = state["nu"].clone(), state["target"].clone()
        self._count, self._turn = state["count"].clone(), int(state["turn"])
