"""Moments of inertia that differ from the nominal ones."""

from __future__ import annotations

from typing import Any

import torch

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter


class InertiaFactors(Effect):
    """Factors on the moments of inertia about the centre of gravity: I <- S I S, S = diag(sqrt(f)).

    It stands for the stated uncertainty of the inertia. As a separate cause it can hardly be told from
    added mass in roll, pitch and yaw, so the catalogue does not offer it.
    Reference: Fossen (2011), section 3.3.
    """

    name = "inertia"
    scales = True
    cause = "the moments of inertia are not the nominal ones"
    symbol = "I_g"
    reference = "Fossen (2011), section 3.3"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one factor per axis of rotation."""
        return tuple(Parameter(axis, "1", 1.0, 0.3, 0.01, 20.0) for axis in ("K", "M", "N"))

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Scale the inertia."""
        root = torch.sqrt(torch.clamp(self.theta, min=1e-12)).to(body.inertia)
        return body.but(inertia=body.inertia * (root.unsqueeze(-1) * root.unsqueeze(-2)))
