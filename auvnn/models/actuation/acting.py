"""What acts on the body beside the thrust, side by side with it: actual fin angles and the propellers' actual speed."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from torch import Tensor

from auvnn.effects import Effect
from auvnn.models.inputs import Inputs

if TYPE_CHECKING:
    from auvnn.models.sensors import Sensors


def follow(effects: Iterable[Effect]) -> bool:
    """Return whether the propellers' speed follows its command, and something depends on it beside the thrust curves.

    Args:
        effects: of a model.
    """
    there = list(effects)
    return any(e.turns for e in there) and any(e.by_speed for e in there)


def speeds_follow(model: Sensors) -> bool:
    """Return `follow` of the effects of a model.

    Args:
        model: in whose equations they act.
    """
    return follow((*model.using("command"), *model.using("thrust")))


def apart(
    model: Sensors, acting: Tensor, inputs: Inputs, size: int
) -> tuple[Tensor, Tensor | None, Tensor | None]:
    """Return thrust (..., n), fin angles (..., m) and the propellers' speed as a command (..., n).

    The angles are those of the inputs, and the speed None, where they do not come after the thrust.

    Args:
        model: whose effects.
        acting: thrust, and what comes after it.
        inputs: of the same moments.
        size: number of thrusters, n.
    """
    more = acting.shape[-1] - size
    if not more:
        return acting, inputs.fins, None
    if not speeds_follow(model):
        thrust, fins = acting.split((size, more), dim=-1)
        return thrust, fins, None
    thrust, fins, speed = acting.split((size, more - size, size), dim=-1)
    return thrust, fins if more > size else inputs.fins, speed
