"""Buoyancy that changes with depth."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.physics.restoring import restoring_force


class Compressibility(Effect):
    """Buoyancy falls with depth: B = B_0 (1 - per_metre z), at the centre of buoyancy.

    Water that grows denser makes a rigid hull lighter (-4e-6 per metre), foam and trapped gas shrink (up to
    1e-2 per metre). At constant depth nothing tells it from net buoyancy.
    Reference: Fossen (2011), section 4.1, with B of the depth.
    """

    name = "compressibility"
    cause = "buoyancy changes with depth"
    symbol = "dB/dz"
    reference = "Fossen (2011), section 4.1"
    confused_with = ("net_buoyancy", "current_shear")
    manoeuvre = "dives"
    told_apart_by = "slow dives over the whole range of depths"
    plainer = ("net_buoyancy",)
    channels = ("z",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the loss per metre of depth, as a share of the buoyancy."""
        return (Parameter("per_metre", "1/m", 0.0, 1e-3, -0.05, 0.05),)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the buoyancy that is lost."""
        lost = self.theta[0].to(moment.nu) * moment.position[..., 2] * body.buoyancy
        return -restoring_force(moment.rotation, torch.zeros_like(lost), -lost, body.cg, body.cb)
