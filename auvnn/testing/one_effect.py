"""A vehicle with one effect, and with what that effect needs beside it to do anything."""

from __future__ import annotations

from collections.abc import Sequence

from auvnn.effects import EFFECTS, Effect
from auvnn.models import GreyBox
from auvnn.testing.scene import Predictor, typical_values
from auvnn.vehicle import Vehicle


def built(kind: type[Effect], vehicle: Vehicle, actuation: str, share: float = 0.4) -> Predictor:
    """Return a predictor of the vehicle with the effect away from its null, and what it acts with.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
        share: of each parameter's scale by which it is away from its null.
    """
    values = typical_values(kind, vehicle, actuation, share)
    effects = [kind.build(vehicle, actuation, values), *beside(kind.acts_with, vehicle, actuation)]
    return Predictor(GreyBox(vehicle, effects, actuation=actuation))


def beside(names: Sequence[str], vehicle: Vehicle, actuation: str) -> list[Effect]:
    """Return what an effect needs beside it to do anything: the first of those with which it acts, or nothing.

    Args:
        names: of the effects with which it acts.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    kinds = map(EFFECTS.get, names[:1])
    return [kind.build(vehicle, actuation, typical_values(kind, vehicle, actuation)) for kind in kinds]
