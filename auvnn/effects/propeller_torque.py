"""Reaction torque of the propellers about their own axes."""

from __future__ import annotations

from typing import Any

import numpy as np
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Moment, Parameter
from auvnn.physics.products import matvec


class PropellerTorque(Effect):
    """Torque in proportion to thrust: moment <- moment + sum_i h_i q T_i d_i, with q = Q/T, a length.

    h is the model file's `handedness`, the sense of the reaction torque about the direction of a positive
    thrust. A commanded wrench has one propulsor along x: K <- K + h q X, h being the thrusters' most usual sense.
    Reference: Prestero (2001), section 4.7; Fossen (2011), section 9.1.
    """

    name = "propeller_torque"
    cause = "the propellers' torque turns the vehicle about their axes"
    symbol = "Q/T"
    reference = "Prestero (2001); Fossen (2011), section 9.1"
    confused_with = ("cg_offset", "constant_force")
    manoeuvre = "pulses"
    told_apart_by = "pushes of single thrusters, forward and in reverse"

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what the model file must state: thrusters with a sense of rotation."""
        known = actuation == "wrench" or any(u.handedness for u in vehicle.thrusters)
        return () if known else ("handedness of a thruster",)

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return torque per thrust; about a tenth of a propeller's diameter is plausible."""
        length = float(vehicle.length)
        return (Parameter("coefficient", "m", 0.0, 0.04 * length, -2 * length, 2 * length),)

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep the wrench of one newton of thrust of each actuator per metre of coefficient."""
        columns = np.zeros((6, 6 if actuation == "wrench" else len(vehicle.thrusters)))
        senses = [u.handedness for u in vehicle.thrusters]
        if actuation == "wrench":
            columns[3, 0] = -1.0 if sum(senses) < 0 else 1.0
        else:
            columns[3:] = np.array(
                [h * u.direction for h, u in zip(senses, vehicle.thrusters, strict=True)]
            ).T
        self.keep("columns", columns)

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the torque."""
        assert moment.thrust is not None
        return self.theta[0].to(moment.nu) * matvec(self.kept("columns").to(moment.nu), moment.thrust)
