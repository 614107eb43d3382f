"""The classical model: linear and quadratic damping on the diagonal, equation 7 of the paper."""

from __future__ import annotations

from collections.abc import Iterable

from auvnn.damping.bank import DampingBank
from auvnn.effects import Effect
from auvnn.models.grey_box import GreyBox
from auvnn.models.structures.base import without_damping
from auvnn.vehicle import Vehicle


def classical(
    vehicle: Vehicle,
    effects: Iterable[Effect] = (),
    actuation: str | None = None,
    seed: int = 0,
    *,
    coupled: bool = False,
) -> GreyBox:
    """Return the model with d_i(nu) = a_i nu_i + b_i |nu_i| nu_i, to be identified by linear least squares.

    Args:
        vehicle: what is known.
        effects: named effects in addition to it.
        actuation: "thrusters" or "wrench".
        seed: taken for the sake of one interface; the coefficients start at zero.
        coupled: also the off-diagonal coefficients, a_ij nu_j + b_ij |nu_j| nu_j; the paper's eq. 7 has none.
    """
    bank = DampingBank.from_description({"form": "polynomial", "coupled": coupled})
    return GreyBox(without_damping(vehicle), effects, bank, actuation)
