"""Sensor noise that is correlated over time: the innovation of each error, given the channel's last measurement.

The noise of a channel is taken as a process of one correlation time, E[n(t) n(s)] = sigma^2 exp(-|t - s| / T). With
rho = exp(-(t_k - t_j) / T) to the measurement j before it, (n_k - rho n_j) / sqrt(1 - rho^2) is independent of all that
came before and has the standard deviation sigma again: errors and their derivatives are replaced by these
innovations (prewhitening), and all that is made for white noise holds. Where T is zero nothing changes.

Reference: Box, Jenkins and Reinsel (2008), Time Series Analysis, section 3.2; Jones (1980), Technometrics 22(3), for
samples that are missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

# Nearer to one another than this, two values of a process say the same.
LARGEST = 0.9999


@dataclass(frozen=True)
class NoiseColour:
    """Correlation times of the sensors' noise.

    Attributes:
        time: (18,), s; zero where the noise is white.
    """

    time: NDArray[np.float64]

    def correlation(self, mask: Tensor, times: Tensor) -> tuple[Tensor, Tensor]:
        """Return each measurement's correlation with the one before it of its channel, and where that is, (B, L, 18).

        Args:
            mask: which channels were measured, (B, L, 18).
            times: of the rows, s, (B, L).
        """
        before = previous(mask)
        known = before.clamp(min=0)
        gap = times.unsqueeze(-1) - torch.gather(times.unsqueeze(-1).expand(*mask.shape), 1, known)
        time = torch.as_tensor(self.time)
        rho = torch.where(time > 0, torch.exp(-gap / time.clamp(min=1e-12)), torch.zeros_like(gap))
        rho = torch.where((before >= 0) & (mask > 0), rho.clamp(max=LARGEST), torch.zeros_like(rho))
        return rho, known

    def whitened(self, values: Tensor, mask: Tensor, times: Tensor) -> Tensor:
        """Return the innovations of errors, or of their derivatives, (B, L, C, ...).

        Args:
            values: the same shape, zero where nothing was measured; C at most 18.
            mask: (B, L, 18).
            times: s, (B, L).
        """
        if not self.time.any():
            return values
        rho, before = (x[..., : values.shape[2]] for x in self.correlation(mask, times))
        more = values.dim() - 3
        rho, before = (x.reshape(*x.shape, *[1] * more) for x in (rho, before))
        last = torch.gather(values, 1, before.expand(*values.shape))
        return (values - rho * last) / torch.sqrt(1.0 - rho**2)

    def log_determinant(self, mask: Tensor, times: Tensor) -> float:
        """Return the logarithm of the determinant of all measurements' correlation matrix."""
        rho, _ = self.correlation(mask, times)
        return float(torch.log1p(-(rho**2)).sum())


def previous(mask: Tensor) -> Tensor:
    """Return the row of the measurement before each row, by channel, (B, L, C); -1 where there is none.

    Args:
        mask: (B, L, C), above zero where a channel was measured.
    """
    rows = torch.arange(mask.shape[1]).reshape(1, -1, 1).expand(*mask.shape)
    last = torch.where(mask > 0, rows, torch.full_like(rows, -1)).cummax(dim=1).values
    return torch.cat([torch.full_like(last[:, :1], -1), last[:, :-1]], dim=1)
