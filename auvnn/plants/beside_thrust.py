"""What acts beside the thrust while a plant goes row by row: fins that follow their commands, and propellers' speeds."""

from __future__ import annotations

import torch
from torch import Tensor

from auvnn.models import GreyBox
from auvnn.models.actuation.acting import speeds_follow
from auvnn.models.actuation.actuators import answer_of, turning


class BesideThrust:
    """Actual fin angles and propellers' speeds of a model whose commands are not known beforehand.

    Args:
        model: with effects by which they follow; without any nothing is done.
    """

    def __init__(self, model: GreyBox) -> None:
        """Begin before the first command."""
        self.model, self.steer = model, answer_of(model.members, "steer")
        self.state: Tensor | None = None
        self.starts: list[Tensor] = []
        self.speeds: list[Tensor] | None = [] if speeds_follow(model) else None

    def command(self, history: Tensor, times: Tensor) -> None:
        """Take the commands so far, of which the last is the present one.

        Args:
            history: (R, T, n).
            times: s, (R, T).
        """
        if self.speeds is not None:
            self.speeds.append(turning(history, times, self.model.members)[..., -1, :])

    def append(
        self, mean: Tensor, slope: Tensor | None, fins: Tensor | None, h: float, first: bool
    ) -> tuple[Tensor, Tensor | None]:
        """Return mean and rise over a step, fin angles and speeds after the thrust, and move the fins on by the step.

        Args:
            mean: of the thrust, N, (R, n).
            slope: its rise, N, (R, n), or None.
            fins: commanded angles, rad, (R, m), or None.
            h: length of the step, s.
            first: whether it is the first of a row.
        """
        if self.steer is not None and fins is not None:
            at = fins if self.state is None else self.state
            turned = self.steer(at, fins, torch.full((1,), h, dtype=mean.dtype))
            if first:
                self.starts.append(turned.start)
            self.state = turned.end
            slope = torch.zeros_like(mean) if slope is None else slope
            mean, slope = torch.cat([mean, turned.mean], dim=-1), torch.cat([slope, turned.slope], dim=-1)
        if self.speeds is None:
            return mean, slope
        speed = self.speeds[-1]
        if slope is not None:
            slope = torch.cat([slope, torch.zeros_like(speed)], dim=-1)
        return torch.cat([mean, speed], dim=-1), slope

    def rows(self) -> tuple[Tensor | None, Tensor | None]:
        """Return fin angles and speeds as each row began, (R, T, m) and (R, T, n), as `Trajectory` holds them."""
        fins = torch.stack(self.starts, dim=-2) if self.starts else None
        return fins, torch.stack(self.speeds, dim=-2) if self.speeds else None
