"""The adjustable weights of damping subnetworks as one matrix: a row per degree of freedom, padded with zeros."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError

# What of each form its output is linear in, or nearly: the last layer.
LAST = {
    "mlp": ("output_weight", "output_bias"),
    "polynomial": ("linear", "quadratic"),
    "dissipative": ("output_weight", "speed_weight", "output_bias"),
    "zero": (),
}
LAYERS = ("all", "last")


class Weights:
    """A view of a bank's parameters as a matrix (6, P), and the Jacobian of its outputs.

    Each output hangs on its own row alone, so that one backward pass through the sum of the six outputs gives
    all six rows of the Jacobian.

    Args:
        bank: the subnetworks; `write` changes them in place.
        layers: "last" for the last layer alone, "all" for every weight.

    Raises:
        ConfigError: there is nothing to adjust.
    """

    def __init__(self, bank: DampingBank, layers: str = "all") -> None:
        """Find the parameters and their places."""
        if layers not in LAYERS:
            raise ConfigError(f"layers={layers!r} is unknown: choose from {', '.join(LAYERS)}")
        self.bank = bank.requires_grad_(True)
        self.layers = layers
        self._groups: list[tuple[Sequence[int], list[torch.nn.Parameter]]] = []
        for form in bank.groups():
            own = dict(form.named_parameters())
            names = list(own) if layers == "all" else LAST.get(form.name, tuple(own))
            found = [own[n] for n in names if n in own]
            if found:
                self._groups.append((form.axes, found))
        widths = [sum(p[0].numel() for p in found) for _, found in self._groups]
        if not widths:
            raise ConfigError("the damping subnetworks have no weights to adapt: choose another damping form")
        self.width = max(widths)
        example = self._groups[0][1][0]
        self.used = torch.zeros(6, self.width, dtype=torch.bool)
        for (axes, _), width in zip(self._groups, widths, strict=True):
            self.used[list(axes), :width] = True
        self._like = example.detach()

    def _filled(self, blocks: Sequence[Sequence[Tensor | None]]) -> Tensor:
        whole = torch.zeros(6, self.width, dtype=self._like.dtype)
        for (axes, found), block in zip(self._groups, blocks, strict=True):
            rows = [
                (torch.zeros_like(p) if b is None else b).detach().reshape(len(axes), -1)
                for p, b in zip(found, block, strict=True)
            ]
            flat = torch.cat(rows, dim=-1)
            whole[list(axes), : flat.shape[1]] = flat
        return whole

    def read(self) -> Tensor:
        """Return the weights (6, P)."""
        return self._filled([found for _, found in self._groups])

    def write(self, matrix: Tensor) -> None:
        """Set the weights from (6, P)."""
        with torch.no_grad():
            for axes, found in self._groups:
                rows, start = matrix[list(axes)], 0
                for parameter in found:
                    count = parameter[0].numel()
                    parameter.copy_(rows[:, start : start + count].reshape(parameter.shape))
                    start += count

    def value(self, nu: Tensor) -> Tensor:
        """Return the outputs in units of the bank's output scale, (..., 6)."""
        with torch.no_grad():
            return self.bank(nu) / self.bank.output_scale

    def jacobian(self, nu: Tensor) -> tuple[Tensor, Tensor]:
        """Return outputs (6,) in units of the output scale, and their slopes by the weights (6, P), at one nu."""
        flat = [p for _, found in self._groups for p in found]
        with torch.enable_grad():
            value = self.bank(nu) / self.bank.output_scale
            slopes = list(torch.autograd.grad(value.sum(), flat, allow_unused=True))
        blocks = [[slopes.pop(0) for _ in found] for _, found in self._groups]
        return value.detach(), self._filled(blocks)

    def jacobians(self, nu: Tensor) -> tuple[Tensor, Tensor]:
        """Return outputs (N, 6) and slopes (N, 6, P) at several velocities (N, 6)."""
        pairs = [self.jacobian(row) for row in nu]
        return torch.stack([p[0] for p in pairs]), torch.stack([p[1] for p in pairs])
