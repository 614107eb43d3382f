"""What damping subnetworks should give, one step ahead: equation 14 of the paper."""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from auvnn.damping.bank import DampingBank
from auvnn.logs import Log
from auvnn.logs.derivatives import LocalPolynomial
from auvnn.metrics.one_step import Derivative, accelerations, inertia_of, integrated
from auvnn.models import GreyBox

Array = NDArray[np.float64]


class _Recorder(nn.Module):
    """Stands in the place of the subnetworks, adds nothing, and remembers what they would have been given."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: Tensor | None = None

    def forward(self, nu_r: Tensor) -> Tensor:
        self.seen = nu_r.detach().clone()
        return torch.zeros_like(nu_r)


def targets(model: GreyBox, log: Log, derivative: Derivative) -> tuple[Array, Array, Array]:
    """Return what the subnetworks should give: velocities, damping wrench and run numbers, over all samples.

    d(nu) = D(nu) nu = M (nu_dot of the model without it - nu_dot measured): equation 14 of Van de Ven, Flanagan
    and Toal (2004). Where accelerations are estimated, velocity and wrench have passed the same filter.

    Returns:
        nu (N, 6) through the water; target (N, 6), NaN where a sample is missing; run (N,).
    """
    recorder = _Recorder()
    bare = GreyBox(model.vehicle, model.copied_effects(), cast(DampingBank, recorder), model.actuation)
    velocities, wrenches, numbers = [], [], []
    for run in log.runs:
        measured, predicted = accelerations(bare, run, derivative)
        assert recorder.seen is not None
        nu = recorder.seen.numpy()
        nu = np.where(run.valid[:, None], nu, np.nan)
        if derivative.method != "measured":
            # The slope of its integral: what the same filter makes of a force that is linear in the velocity.
            nu = LocalPolynomial(run.t, derivative.half_width, derivative.order)(integrated(run.t, nu))[1]
        velocities.append(nu)
        wrenches.append((predicted - measured) @ inertia_of(bare, run).T)
        numbers.append(np.full(run.samples, run.number))
    return np.concatenate(velocities), np.concatenate(wrenches), np.concatenate(numbers)
