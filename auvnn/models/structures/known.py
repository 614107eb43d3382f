"""The known model alone: equation 13 of the paper."""

from __future__ import annotations

from collections.abc import Iterable

from auvnn.effects import Effect
from auvnn.models.grey_box import GreyBox
from auvnn.models.structures.base import without_damping
from auvnn.vehicle import Vehicle


def known(
    vehicle: Vehicle, effects: Iterable[Effect] = (), actuation: str | None = None, seed: int = 0
) -> GreyBox:
    """Return M nu_dot + C(nu) nu + g(eta) = tau: everything but the damping, and nothing learned.

    Args:
        vehicle: what is known.
        effects: named effects in addition to it.
        actuation: "thrusters" or "wrench".
        seed: taken for the sake of one interface; there is nothing to draw.
    """
    return GreyBox(without_damping(vehicle), effects, None, actuation)
