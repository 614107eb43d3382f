"""Water whose motion the drag feels more than the rest of the vehicle does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from auvnn.effects.base import Effect, Moment, Parameter


class DragOnlyCurrent(Effect):
    """A share s of the water's motion is felt by the drag alone: nu_r = nu - (1 - s) nu_c in all other terms.

    In M_A (nu_r)_dot + C_A(nu_r) nu_r + D(nu_r) nu_r the water moves in each term. Simulators often put the current
    into the drag alone (s = 1), and waves that are short beside the hull push its added mass less than their orbital
    velocity at its middle says, by a share in between. Drag: damping matrices, elements and networks, `drag_curve`,
    `cross_flow_drag` and the cable of `tether`; all else, fins and propellers too, feels nu_r as above. It acts where a
    current, a shear or waves move the water, and nowhere else.
    Reference: Fossen (2011), section 8.3; Fossen (2012), How to incorporate wind, waves and ocean currents, IFAC MCMC.
    """

    name = "drag_only_current"
    cause = "the water's motion acts through the drag more than through added mass, fins and propellers"
    symbol = "s_c"
    reference = "Fossen (2011), section 8.3"
    acts_with = ("ocean_current", "current_shear", "waves")
    confused_with = ("added_mass_coriolis", "current_shear")
    manoeuvre = "rotation"
    told_apart_by = "turning in the current: added mass feels how its direction changes, drag does not"

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the share; a half is as plausible as all of it."""
        return (Parameter("share", "1", 0.0, 0.5, -1.0, 2.0),)

    def flow(self, moment: Moment) -> Moment:
        """Return the moment in which the drag feels all of the water's motion, and the rest what is left."""
        share, through = self.theta[0].to(moment.nu), moment.drag_flow
        felt = moment.nu_r + share * (moment.nu - moment.nu_r)
        return replace(moment, nu_r=felt, nu_c_dot=(1.0 - share) * moment.nu_c_dot, dragged=through)
