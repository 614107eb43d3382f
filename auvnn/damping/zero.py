"""No damping at all: for a degree of freedom that is to stay with the known physics."""

from __future__ import annotations

from torch import Tensor

from auvnn.damping.base import DampingForm


class Zero(DampingForm):
    """d_i(nu) = 0, without parameters."""

    name = "zero"

    def forward(self, nu: Tensor) -> Tensor:
        """Return zeros (..., n)."""
        return nu.new_zeros((*nu.shape[:-1], len(self.axes)))
