"""Networks with one tanh layer: several separate ones side by side, or one with several outputs."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from auvnn.damping.base import draw, positive_int, true_or_false


class Networks(nn.Module):
    """y = output_scale f(x / input_scale), by one network for each output or by one network for all of them.

    separate: f_i(x) = c_i + sum_k a_ik tanh(b_ik + W_ik x);  shared: f_i(x) = c_i + sum_k a_ik tanh(b_k + W_k x)

    The scales are buffers: they travel with the weights but are not trained.

    Args:
        inputs: number of inputs.
        outputs: number of outputs.
        hidden: tanh units, of each network or of the one.
        shared: one network with several outputs, instead of a network for each.
        seed: of the initial weights.
    """

    input_scale: Tensor
    output_scale: Tensor

    def __init__(self, inputs: int, outputs: int, *, hidden: int, shared: bool, seed: int = 0) -> None:
        """Make the weights and draw them."""
        super().__init__()
        self.inputs, self.outputs = inputs, outputs
        self.hidden = positive_int(hidden, "structure option 'hidden'")
        self.shared = true_or_false(shared, "structure option 'shared'")
        lead = (hidden,) if shared else (outputs, hidden)
        self.hidden_weight = nn.Parameter(torch.zeros(*lead, inputs, dtype=torch.float64))
        self.hidden_bias = nn.Parameter(torch.zeros(*lead, dtype=torch.float64))
        self.output_weight = nn.Parameter(torch.zeros(outputs, hidden, dtype=torch.float64))
        self.output_bias = nn.Parameter(torch.zeros(outputs, dtype=torch.float64))
        self.register_buffer("input_scale", torch.ones(inputs, dtype=torch.float64))
        self.register_buffer("output_scale", torch.ones(outputs, dtype=torch.float64))
        self.reset(seed)

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild the networks, as plain data."""
        return {"hidden": self.hidden, "shared": self.shared}

    def reset(self, seed: int) -> None:
        """Draw hidden weights evenly from +-1/sqrt(number of inputs); the outputs start at zero."""
        generator = torch.Generator().manual_seed(seed)
        bound = 1.0 / math.sqrt(self.inputs)
        with torch.no_grad():
            for tensor in (self.hidden_weight, self.hidden_bias):
                tensor.copy_(draw(tensor.shape, bound, generator, tensor))
            self.output_weight.zero_()
            self.output_bias.zero_()

    def fit_to_data(self, x: Tensor, y: Tensor, generator: torch.Generator) -> None:
        """Set the scales to the data's root mean square, and draw hidden layers that bend where the data is.

        Random directions, scaled so that the argument of tanh has standard deviation 1/2 over the data, each unit
        centred on a sample; the same rule as for the damping subnetworks. The output layer is then solved for by
        least squares.

        Args:
            x: inputs (N, inputs).
            y: what the networks should give (N, outputs).
            generator: of the draws.
        """
        with torch.no_grad():
            for scale, data in ((self.input_scale, x), (self.output_scale, y)):
                rms = data.square().mean(0).sqrt()
                scale.copy_(torch.where(rms > 1e-12, rms, 1.0))
            x, y = x / self.input_scale, y / self.output_scale
            shape = self.hidden_weight.shape
            weight = torch.randn(shape, generator=generator, dtype=torch.float64)
            rows = x[torch.randint(len(x), shape[:-1], generator=generator)]
            centred = x - x.mean(0)
            covariance = centred.T @ centred / len(x)
            spread = ((weight @ covariance) * weight).sum(-1, keepdim=True).clamp_min(0.0).sqrt()
            weight = 0.5 * weight / spread.clamp_min(1e-6)
            self.hidden_weight.copy_(weight)
            self.hidden_bias.copy_(-(rows * weight).sum(-1))
            self.solve_outputs(x * self.input_scale, y * self.output_scale)

    def solve_outputs(self, x: Tensor, y: Tensor, ridge: float = 1e-8) -> None:
        """Set the output layer to the least-squares solution for inputs x (N, inputs) and outputs y (N, outputs).

        Args:
            x: inputs, (N, inputs).
            y: outputs, (N, outputs).
            ridge: relative to the diagonal of the normal equations.
        """
        with torch.no_grad():
            units, target = self._units(x / self.input_scale), y / self.output_scale
            for i in range(self.outputs):
                own = units if self.shared else units[:, i]
                columns = torch.cat([own, torch.ones_like(own[:, :1])], -1)
                normal = columns.T @ columns
                normal += ridge * torch.diag(normal.diagonal().clamp_min(1e-12))
                solution = torch.linalg.solve(normal, columns.T @ target[:, i])
                self.output_weight[i] = solution[:-1]
                self.output_bias[i] = solution[-1]

    def _units(self, x: Tensor) -> Tensor:
        weight = self.hidden_weight.flatten(0, -2)
        units = torch.tanh(functional.linear(x, weight, self.hidden_bias.flatten()))
        return units if self.shared else units.unflatten(-1, (self.outputs, self.hidden))

    def forward(self, x: Tensor) -> Tensor:
        """Return the outputs (..., outputs) for inputs (..., inputs)."""
        units = self._units(x / self.input_scale)
        if self.shared:
            scaled = functional.linear(units, self.output_weight, self.output_bias)
        else:
            scaled = (units * self.output_weight).sum(-1) + self.output_bias
        return scaled * self.output_scale
