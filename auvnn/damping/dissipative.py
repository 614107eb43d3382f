"""Damping that cannot add energy, whatever its parameters are."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from auvnn.damping.base import DampingForm, positive_int, redraw


class Dissipative(DampingForm):
    """The own velocity times a positive function of the speeds, so that nu_i d_i(nu) >= 0 always.

    d_i(nu) = nu_i softplus(c_i + sum_j s_ij |nu_j| + sum_k a_ik tanh(b_ik + sum_j W_ikj |nu_j|))

    The part linear in |nu| makes linear plus quadratic damping easy to reach, and lets the form grow like
    quadratic drag beyond the data, where tanh units alone would go flat. At rest d = 0 exactly. A force
    across the motion (a lift, an off-diagonal coefficient) does not fit into this form.

    Args:
        axes: degrees of freedom, numbers 0 to 5.
        hidden: tanh units of each degree of freedom.
    """

    name = "dissipative"

    def __init__(self, axes: Sequence[int], *, hidden: int = 5) -> None:
        """Build the stacked weights and draw them with seed 0."""
        super().__init__(axes)
        self.hidden = positive_int(hidden, "damping option 'hidden'")
        n, h = len(self.axes), self.hidden
        self.hidden_weight = nn.Parameter(torch.zeros(n, h, 6, dtype=torch.float64))
        self.hidden_bias = nn.Parameter(torch.zeros(n, h, dtype=torch.float64))
        self.output_weight = nn.Parameter(torch.zeros(n, h, dtype=torch.float64))
        self.speed_weight = nn.Parameter(torch.zeros(n, 6, dtype=torch.float64))
        self.output_bias = nn.Parameter(torch.zeros(n, dtype=torch.float64))
        self.reset(torch.Generator().manual_seed(0))

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this form."""
        return {"hidden": self.hidden}

    def reset(self, generator: torch.Generator) -> None:
        """Draw the network's weights evenly from +-1/sqrt(inputs); start near d_i = nu_i."""
        redraw(generator, (self.hidden_weight, 6), (self.hidden_bias, 6), (self.output_weight, self.hidden))
        with torch.no_grad():
            self.speed_weight.zero_()
            self.output_bias.fill_(math.log(math.e - 1.0))  # softplus of this is one

    def forward(self, nu: Tensor) -> Tensor:
        """Return the damping (..., n); see the class for the equation."""
        speed = nu.abs()
        weight = self.hidden_weight.flatten(0, 1)
        hidden = torch.tanh(functional.linear(speed, weight, self.hidden_bias.flatten()))
        hidden = hidden.unflatten(-1, (len(self.axes), self.hidden))
        inner = (hidden * self.output_weight).sum(-1) + functional.linear(
            speed, self.speed_weight, self.output_bias
        )
        return nu[..., list(self.axes)] * functional.softplus(inner)
