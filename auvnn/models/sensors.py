"""What sensors report of a state, and which state stands behind a report, by the effects that act on sensors."""

from __future__ import annotations

import torch
from torch import nn

from auvnn.effects import Effect, Sensed


class Sensors(nn.Module):
    """What a model's effects make of what is measured."""

    _by_hook: dict[str, list[Effect]]

    def using(self, hook: str) -> list[Effect]:
        """Return the effects that override a hook, in order of action."""
        return self._by_hook[hook]

    def sense(self, sensed: Sensed) -> Sensed:
        """Return what the sensors report of a state."""
        for effect in self.using("sense"):
            sensed = effect.sense(sensed)
        return sensed

    def unsense(self, sensed: Sensed, rounds: int = 4) -> Sensed:
        """Return the state that the sensors' report stands for, by fixed-point iteration.

        Sensor effects are small corrections, so each round gains about as many digits as they are small.
        """
        if not self.using("sense"):
            return sensed
        state = sensed
        for _ in range(rounds):
            seen = self.sense(state)
            rate = None
            if sensed.nu_dot is not None and state.nu_dot is not None and seen.nu_dot is not None:
                rate = state.nu_dot + sensed.nu_dot - seen.nu_dot
            quaternion = state.quaternion + sensed.quaternion - seen.quaternion
            quaternion = quaternion / torch.linalg.norm(quaternion, dim=-1, keepdim=True)
            state = Sensed(
                state.position + sensed.position - seen.position,
                quaternion,
                state.nu + sensed.nu - seen.nu,
                rate,
            )
        return state
