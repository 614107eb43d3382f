"""Linear and quadratic damping with free cross terms: linear in its coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn

from auvnn.damping.base import DampingForm, true_or_false


class Polynomial(DampingForm):
    """The classical law, whose coefficients one linear least-squares solution gives.

    d_i(nu) = sum_j a_ij nu_j + b_ij |nu_j| nu_j,  over all j, or over j = i alone

    Args:
        axes: degrees of freedom, numbers 0 to 5.
        coupled: sum over all six velocities (true), or over the axis' own velocity alone (false).

    References:
        Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, section on nonlinear damping.
    """

    name = "polynomial"

    def __init__(self, axes: Sequence[int], *, coupled: bool = True) -> None:
        """Start with all coefficients zero."""
        super().__init__(axes)
        self.coupled = true_or_false(coupled, "damping option 'coupled'")
        shape = (len(self.axes), 6 if self.coupled else 1)
        self.linear = nn.Parameter(torch.zeros(shape, dtype=torch.float64))
        self.quadratic = nn.Parameter(torch.zeros(shape, dtype=torch.float64))

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this form."""
        return {"coupled": self.coupled}

    def reset(self, generator: torch.Generator) -> None:
        """Set all coefficients to zero; the generator is not used."""
        with torch.no_grad():
            self.linear.zero_()
            self.quadratic.zero_()

    def forward(self, nu: Tensor) -> Tensor:
        """Return the polynomial (..., n); see the class for the equation."""
        if self.coupled:
            return nu @ self.linear.mT + (nu.abs() * nu) @ self.quadratic.mT
        own = nu[..., list(self.axes)]
        return own * (self.linear[:, 0] + own.abs() * self.quadratic[:, 0])

    def regressors(self, nu: Tensor, member: int) -> Tensor:
        """Return the columns (..., p) that the coefficients [a, b] of axis number `member` multiply."""
        own = nu if self.coupled else nu[..., [self.axes[member]]]
        return torch.cat([own, own.abs() * own], dim=-1)

    def coefficients(self, input_scale: Tensor, output_scale: Tensor) -> tuple[Tensor, Tensor]:
        """Return the coefficients in SI units when the form sits in a bank with these scales.

        Args:
            input_scale: (6,) velocity scale of the bank.
            output_scale: (6,) force scale of the bank.

        Returns:
            Rows of D_L (n, 6) and of D_Q (n, 6), one row per axis of the form.
        """
        rows, force = torch.arange(len(self.axes)), output_scale[list(self.axes), None]
        answer = []
        for tensor, power in ((self.linear, 1), (self.quadratic, 2)):
            full = tensor.detach()
            if not self.coupled:
                full = torch.zeros(len(self.axes), 6, dtype=tensor.dtype, device=tensor.device)
                full[rows, list(self.axes)] = tensor.detach()[:, 0]
            answer.append(full * force / input_scale**power)
        return answer[0], answer[1]
