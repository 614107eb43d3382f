"""The paper's damping network: velocity and its magnitude in, tanh hidden units, a linear output."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from auvnn.damping.base import DampingForm, positive_int, redraw, true_or_false
from auvnn.errors import ConfigError

INPUTS = ("absolute", "quadratic")


class MLP(DampingForm):
    """One independent 12-h-1 network per degree of freedom, stacked so that all run as one product.

    d_i(nu) = c_i + sum_k a_ik tanh(b_ik + sum_j W_ikj x_j),  x = [nu, |nu|]  (or [nu, |nu| nu])

    Args:
        axes: degrees of freedom, numbers 0 to 5.
        hidden: hidden units of each network (the paper: 5).
        inputs: `absolute` for [nu, |nu|] as in the paper, `quadratic` for [nu, |nu| nu].
        zero_at_rest: subtract the network's value at rest, so that d(0) = 0 exactly; the output bias c, which
            this would cancel, is then left out. The paper does not do so.

    References:
        van de Ven et al., Identification of the damping of underwater vehicles by neural networks, IFAC CAMS
        2004: 12 inputs, 5 tanh hidden units, 1 linear output, biases in both layers.
    """

    name = "mlp"

    def __init__(
        self,
        axes: Sequence[int],
        *,
        hidden: int = 5,
        inputs: str = "absolute",
        zero_at_rest: bool = False,
    ) -> None:
        """Build the stacked weights and draw them with seed 0."""
        super().__init__(axes)
        self.hidden = positive_int(hidden, "damping option 'hidden'")
        if inputs not in INPUTS:
            raise ConfigError(f"damping option 'inputs' is {inputs!r}: there are {', '.join(INPUTS)}")
        self.inputs = inputs
        self.zero_at_rest = true_or_false(zero_at_rest, "damping option 'zero_at_rest'")
        n, h = len(self.axes), self.hidden
        self.hidden_weight = nn.Parameter(torch.zeros(n, h, 12, dtype=torch.float64))
        self.hidden_bias = nn.Parameter(torch.zeros(n, h, dtype=torch.float64))
        self.output_weight = nn.Parameter(torch.zeros(n, h, dtype=torch.float64))
        bias = None if self.zero_at_rest else nn.Parameter(torch.zeros(n, dtype=torch.float64))
        self.output_bias: nn.Parameter | None
        self.register_parameter("output_bias", bias)
        self.reset(torch.Generator().manual_seed(0))

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this form."""
        return {"hidden": self.hidden, "inputs": self.inputs, "zero_at_rest": self.zero_at_rest}

    def reset(self, generator: torch.Generator) -> None:
        """Draw all weights evenly from +-1/sqrt(number of inputs of the unit)."""
        redraw(generator, (self.hidden_weight, 12), (self.hidden_bias, 12), (self.output_weight, self.hidden))
        with torch.no_grad():
            if self.output_bias is not None:
                self.output_bias.zero_()

    def features(self, nu: Tensor) -> Tensor:
        """Return the networks' inputs x (..., 12)."""
        size = nu.abs()
        return torch.cat([nu, size if self.inputs == "absolute" else size * nu], dim=-1)

    def forward(self, nu: Tensor) -> Tensor:
        """Return the networks' outputs (..., n); see the class for the equation."""
        weight = self.hidden_weight.flatten(0, 1)
        hidden = torch.tanh(functional.linear(self.features(nu), weight, self.hidden_bias.flatten()))
        hidden = hidden.unflatten(-1, (len(self.axes), self.hidden))
        if self.output_bias is None:
            return ((hidden - torch.tanh(self.hidden_bias)) * self.output_weight).sum(-1)
        return (hidden * self.output_weight).sum(-1) + self.output_bias
