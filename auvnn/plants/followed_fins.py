"""Fins that follow their commands while a plant goes row by row."""

from __future__ import annotations

import torch
from torch import Tensor

from auvnn.models import GreyBox
from auvnn.models.actuation.actuators import answer_of


class FollowedFins:
    """The actual fin angles of a model whose commands are not known beforehand, from the first command on.

    Args:
        model: with an effect by which the fins follow; without one nothing is done.
    """

    def __init__(self, model: GreyBox) -> None:
        """Begin before the first command."""
        self.steer = answer_of(model.members, "steer")
        self.state: Tensor | None = None
        self.starts: list[Tensor] = []

    def append_fins(
        self, mean: Tensor, slope: Tensor | None, fins: Tensor | None, h: float, first: bool
    ) -> tuple[Tensor, Tensor | None]:
        """Return mean and rise over a step, the fin angles after the thrust, and move on by the step.

        Args:
            mean: of the thrust, N, (R, n).
            slope: its rise, N, (R, n), or None.
            fins: commanded angles, rad, (R, m), or None.
            h: length of the step, s.
            first: whether it is the first of a row.
        """
        if self.steer is None or fins is None:
            return mean, slope
        at = fins if self.state is None else self.state
        turned = self.steer(at, fins, torch.full((1,), h, dtype=mean.dtype))
        if first:
            self.starts.append(turned.start)
        self.state = turned.end
        slope = torch.zeros_like(mean) if slope is None else slope
        return torch.cat([mean, turned.mean], dim=-1), torch.cat([slope, turned.slope], dim=-1)

    def angles(self) -> Tensor | None:
        """Return the angles as each row began, (R, T, m); None where they are the commanded ones."""
        return torch.stack(self.starts, dim=-2) if self.starts else None
