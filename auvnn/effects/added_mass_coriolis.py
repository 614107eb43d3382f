"""Coriolis and centripetal forces of the added mass that are not the ideal ones."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.physics.coriolis import coriolis_force


class AddedMassCoriolis(Effect):
    """One factor on the Coriolis and centripetal forces of the added mass: C_A(nu_r) nu_r <- k C_A(nu_r) nu_r.

    In an ideal fluid k = 1 (Kirchhoff). A hull that sheds vortices loses a part of these forces, and simulators and
    simplified models often leave them out (k = 0) while they keep the added mass itself. The wrench is (1 - k) C_A nu_r.
    The Munk moment is a part of it; `munk_moment` changes that part alone.
    Reference: Fossen (2011), section 6.3.2; Lamb (1932), Hydrodynamics, section 124.
    """

    name = "added_mass_coriolis"
    cause = "the Coriolis forces of the added mass are not the ideal ones"
    symbol = "k_CA"
    reference = "Fossen (2011), section 6.3.2; Lamb (1932), section 124"
    confused_with = ("munk_moment", "body_lift", "turning_forces", "added_mass")
    manoeuvre = "rotation"
    told_apart_by = "turning while moving ahead and sideways, then straight runs at an angle of drift"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the factor; a half is lost as easily as all of it."""
        return (Parameter("factor", "1", 1.0, 0.5, -2.0, 4.0),)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return what is to be added to the ideal forces."""
        return (1.0 - self.theta[0].to(moment.nu_r)) * coriolis_force(
            body.added_mass.to(moment.nu_r), moment.nu_r
        )
