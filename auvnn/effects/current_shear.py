"""A current that grows with depth."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Moment, Parameter


class CurrentShear(Effect):
    """Horizontal current in proportion to depth: v = z [north east 0], in addition to a steady one.

    The vehicle that rises or sinks meets a changing current, with acceleration z_dot [north east 0]. The
    rotation of the water, half the gradient, is left out. Reference: DNV-RP-C205 (2010), section 4.
    """

    name = "current_shear"
    cause = "the current changes with depth"
    symbol = "dv_c/dz"
    reference = "DNV-RP-C205 (2010), section 4"
    confused_with = ("ocean_current", "velocity_scale")
    manoeuvre = "dives"
    told_apart_by = "legs at several depths and headings"
    plainer = ("ocean_current",)
    channels = ("z",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the gradients."""
        return tuple(Parameter(n, "1/s", 0.0, 0.05, -5.0, 5.0) for n in ("north", "east"))

    def water(self, moment: Moment) -> tuple[Tensor, Tensor]:
        """Return the current at the vehicle's depth and its change along the way."""
        gradient = torch.nn.functional.pad(self.theta.to(moment.position), (0, 1))
        sinking = (moment.rotation[..., 2, :] * moment.nu[..., :3]).sum(-1, keepdim=True)
        return moment.position[..., 2:] * gradient, sinking * gradient
