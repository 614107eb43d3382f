"""Learned damping under diagnosis: only what drag can be is kept of it, and that is uncertain.

Subnetworks of the velocity absorb nearly any missing effect on the manoeuvre that they were trained on, and what
they have absorbed leaves no residual to be tested. A diagnosis therefore puts in their place the drag law that
comes nearest to them along the log,

    d_i(nu) = sum_j a_ij nu_j + sum_jk b_ikj |nu_k| nu_j,

and lets each coefficient move by a stated share of what was learned (`effects.learned_drag`). The law is no richer
than its uncertainty, so that whatever of an effect has got into it can be taken back. A force at rest, a drift of
the water, a moment that is there at one attitude only: what is no drag comes back as a residual, and can be named.
"""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from auvnn.damping.bank import DampingBank
from auvnn.effects.learned_drag import products
from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import carried_over

Array = NDArray[np.float64]
# Standard deviation of each correction, as a share of the learned force at usual speeds: of nu_j and |nu_j| nu_j,
# and of the products of two velocities, of which there are many. Ours.
SHARE, COUPLED = 0.3, 0.1
OWN = np.concatenate([np.ones(6, dtype=bool), np.eye(6, dtype=bool).ravel()])
# A speed that is hardly there tells nothing of its coefficients.
RIDGE = 1e-6


class DragLaw(nn.Module):
    """A drag law of fixed coefficients, in the place of subnetworks.

    Args:
        coefficients: (6, 42), as `effects.learned_drag` orders them.
    """

    def __init__(self, coefficients: Array) -> None:
        """Keep them."""
        super().__init__()
        self.register_buffer("coefficients", torch.as_tensor(coefficients), persistent=False)

    def forward(self, nu: Tensor) -> Tensor:
        """Return d(nu), (..., 6)."""
        return products(nu) @ self.get_buffer("coefficients").to(nu).mT


def has_learned(model: GreyBox) -> bool:
    """Whether the model holds damping that was learned and not merely stated."""
    return model.damping is not None and bool(list(model.damping.parameters()))


def with_drag_only(model: GreyBox, log: Log) -> tuple[GreyBox, Array | None]:
    """Return the model with nothing but drag left of its subnetworks, and how uncertain that is.

    Args:
        model: any model; one without learned damping comes back as it is.
        log: along its velocities the law is laid out.

    Returns:
        the model; standard deviations (252,) of `learned_drag`'s parameters, or None.
    """
    bank = model.damping
    if bank is None or not has_learned(model):
        return model, None
    nu = np.concatenate([run.nu[run.valid & np.isfinite(run.nu).all(1)] for run in log.runs])
    with torch.no_grad():
        wrench = bank(torch.as_tensor(nu).to(bank.input_scale)).double().numpy()
    usual = np.maximum(np.sqrt(np.mean(nu**2, axis=0)), 1e-6)
    unit = products(torch.as_tensor(usual)).numpy()
    columns = products(torch.as_tensor(nu)).numpy() / unit
    gram = columns.T @ columns + RIDGE * len(nu) * np.eye(len(unit))
    coefficients = np.linalg.solve(gram, columns.T @ wrench).T / unit
    law = cast(DampingBank, DragLaw(coefficients))
    size = np.sqrt(np.mean(wrench**2, axis=0))
    spread = np.outer(size, np.where(OWN, SHARE, COUPLED) / unit).ravel()
    made = GreyBox(model.vehicle, model.copied_effects(), law, model.actuation)
    return carried_over(made, model), np.maximum(spread, 1e-9)
