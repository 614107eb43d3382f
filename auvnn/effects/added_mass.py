"""Added mass that differs from the nominal one."""

from __future__ import annotations

from auvnn.effects.factors import AxisFactors, axis_scale
from auvnn.effects.hooks import Body, Moment


class AddedMass(AxisFactors):
    """Factors on the added mass, and so on its Coriolis terms too.

    M_A <- S M_A S with S = diag(sqrt(f)). Reference: Fossen (2011), chapter 6; SNAME (1950).
    """

    name = "added_mass"
    cause = "the added mass is not the nominal one"
    symbol = "M_A"
    reference = "Fossen (2011), chapter 6"
    confused_with = ("trapped_water", "thruster_lag", "actuation_delay", "thruster_gain", "fin_lag")
    manoeuvre = "chirp"
    # One mass for all axes explains the same trace with one number where these are six.
    plainer = ("trapped_water",)
    told_apart_by = (
        "swept sines: inertia grows with the square of the frequency, a lag does not depend on the amplitude"
    )

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Scale the added mass."""
        return body.but(added_mass=body.added_mass * axis_scale(self.theta).to(body.added_mass))
