"""Effects that only add what is linear in their parameters: their slopes are worked out once, and not differentiated.

Reverse mode goes back through a hook once for each of the six accelerations, and through all that the hook computed for
each of its parameters. Where what a hook adds is linear in many parameters (a wave of twenty frequencies), it is
cheaper to note its slopes on the way forward, to differentiate by the few numbers that are added, and to multiply.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor
from torch.func import vmap

from auvnn.effects import Effect
from auvnn.estimation.few_inputs import slopes

# What one effect adds at one point: a list of tensors for each time that one of its hooks was called.
Added = list[list[Tensor]]


class LinearEffect(Effect):
    """An effect of S sets of P parameters each, `theta` (S P), whose hooks add what `added` returns.

    What is added must be linear in theta, and no derivative of it but that by theta may be needed.
    """

    _noted: Added | None = None
    _given: Added | None = None

    def added(
        self, one: Callable[[Tensor, Tensor], Sequence[Tensor]], start: Tensor, held: Tensor
    ) -> list[Tensor]:
        """Return the parts that are added: slopes times the distance of theta from its start.

        Args:
            one: the parts as functions of one set of parameters (P,) and of what is held with it.
            start: (S, P).
            held: (S, ...).
        """
        if self._given is not None:
            return self._given.pop(0)
        found = vmap(lambda values, other: slopes(lambda some: one(some, other), values))(start, held)
        if self._noted is not None:
            self._noted.append(found)
            return [x.new_zeros(x.shape[1:-1]) for x in found]
        moved = (self.theta - start.flatten()).unflatten(0, start.shape)
        return [torch.einsum("s...p,sp->...", slope, moved.to(slope)) for slope in found]


def record_slopes(effects: Sequence[LinearEffect], run: Callable[[], Any]) -> list[Added]:
    """Run something, and return the slopes (S, ..., P) of all that the effects would have added, effect by effect."""
    try:
        for effect in effects:
            effect._noted = []
        run()
        return [effect._noted or [] for effect in effects]
    finally:
        for effect in effects:
            effect._noted = None


def with_slopes(effects: Sequence[LinearEffect], parts: Sequence[Added], run: Callable[[], Tensor]) -> Tensor:
    """Run something with what the effects add given, in the order in which it was noted.

    Args:
        effects: that are replayed.
        parts: what each of them adds, call by call, as `record_slopes` noted it.
        run: what is run with it.
    """
    try:
        for effect, calls in zip(effects, parts, strict=True):
            effect._given = [list(call) for call in calls]
        return run()
    finally:
        for effect in effects:
            effect._given = None


def zero_slopes(slopes_of: Sequence[Added]) -> list[Added]:
    """Return zeros for all that is added at one point, of slopes (N, S, ..., P) at many."""
    return [[[x.new_zeros(x.shape[2:-1]) for x in call] for call in calls] for calls in slopes_of]


def concatenate_slopes(by_added: Added, slopes_of: Added) -> Tensor:
    """Return the derivative by theta, (N, out, S P), from that by what is added and the slopes of that.

    Args:
        by_added: (N, out, ...) each.
        slopes_of: (N, S, ..., P) each.
    """
    left = [x.reshape(*x.shape[:2], -1) for call in by_added for x in call]
    flat = [x.reshape(*x.shape[:2], -1, x.shape[-1]) for call in slopes_of for x in call]
    right = [x.movedim(2, 1).flatten(2) for x in flat]
    return torch.cat(left, dim=-1) @ torch.cat(right, dim=1)
