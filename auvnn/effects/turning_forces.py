"""Forces and moments that grow with speed times turn rate, beyond what the added mass gives."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter

# Parameter: (axis of the wrench, linear velocity, rate), as indices into [u v w p q r] and [X Y Z K M N].
PRODUCTS = {
    "Xvr": (0, 1, 5),
    "Xwq": (0, 2, 4),
    "Yur": (1, 0, 5),
    "Ywp": (1, 2, 3),
    "Zuq": (2, 0, 4),
    "Zvp": (2, 1, 3),
    "Kwq": (3, 2, 4),
    "Kvr": (3, 1, 5),
    "Muq": (4, 0, 4),
    "Mvp": (4, 1, 3),
    "Nur": (5, 0, 5),
    "Nwp": (5, 2, 3),
}


class TurningForces(Effect):
    """Products of speed and turn rate: X += Xvr v r + Xwq w q and so on, in velocities through the water.

    The added mass gives such terms too, with coefficients that follow from it (Xvr = -Y_vdot, ...). Of a body
    with separated flow the measured ones differ, which is why the standard equations of motion of submarines
    keep them apart. They need not conserve energy.
    Reference: Gertler and Hagen (1967), DTMB report 2510; Prestero (2001), sections 4.3 and 4.4.
    """

    name = "turning_forces"
    cause = "forces in a turn are not those of the added mass"
    symbol = "Y_ur"
    reference = "Gertler and Hagen (1967), DTMB report 2510"
    confused_with = ("added_mass", "body_lift", "munk_moment", "added_mass_coriolis")
    manoeuvre = "rotation"
    told_apart_by = "turns at several speeds"
    plainer = ("coupled_damping",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return one coefficient a product; a good part of mass and of mass times length is plausible."""
        mass, length = float(vehicle.mass), float(vehicle.length)
        out = []
        for name, (axis, _, _) in PRODUCTS.items():
            scale, unit = (mass, "kg") if axis < 3 else (0.2 * mass * length, "kg m")
            out.append(Parameter(name, unit, 0.0, 0.5 * scale, -50 * scale, 50 * scale))
        return tuple(out)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the products times their coefficients, each on its axis."""
        nu = moment.nu_r
        axes, first, second = (list(x) for x in zip(*PRODUCTS.values(), strict=True))
        parts = nu[..., first] * nu[..., second] * self.theta.to(nu)
        onto = torch.zeros(6, len(axes), dtype=nu.dtype, device=nu.device)
        onto[axes, list(range(len(axes)))] = 1.0
        return parts @ onto.mT
