"""What damping subnetworks should give, one step ahead: equation 14 of the paper."""

from __future__ import annotations

from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from auvnn.damping.bank import DampingBank
from auvnn.logs import Log, Run
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.metrics.derivative import Derivative, integrated
from auvnn.metrics.one_step import accelerations, inertia_of
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

    Args:
        model: with or without subnetworks; what they give is left out.
        log: measurements.
        derivative: how accelerations are obtained.

    Returns:
        nu (N, 6) through the water; target (N, 6), NaN where a sample is missing; run (N,).
    """
    each = Targets(model, derivative)
    found = [each(run) for run in log.runs]
    numbers = [np.full(run.samples, run.number) for run in log.runs]
    return (
        np.concatenate([nu for nu, _ in found]),
        np.concatenate([d for _, d in found]),
        np.concatenate(numbers),
    )


class Targets:
    """Gives a run's velocities and targets, as `targets` does for all runs of a log.

    Args:
        model: the model.
        derivative: how accelerations are obtained.
    """

    def __init__(self, model: GreyBox, derivative: Derivative) -> None:
        """Take the model without its subnetworks."""
        self.derivative, self._recorder = derivative, _Recorder()
        bank = cast(DampingBank, self._recorder)
        self.bare = GreyBox(model.vehicle, model.copied_effects(), bank, model.actuation)

    def __call__(self, run: Run, opening: float | None = None) -> tuple[Array, Array]:
        """Return nu and target, (N, 6) each.

        Args:
            run: measurements.
            opening: time at which the run began that they are a part of, s; their own begin by default.
        """
        how = self.derivative
        measured, predicted = accelerations(self.bare, run, how)
        assert self._recorder.seen is not None
        nu = self._recorder.seen.numpy()
        nu = np.where(run.valid[:, None], nu, np.nan)
        if how.method != "measured":
            # The slope of its integral: what the same filter makes of a force that is linear in the velocity.
            nu = LocalPolynomial(run.t, how.half_width, how.order)(integrated(run.t, nu))[1]
        return nu, (predicted - measured) @ inertia_of(self.bare, run, opening).T
