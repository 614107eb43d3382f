"""The thrust as a function of time, so that it can be asked for at any moment and not only at the rows."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from auvnn.effects import Response

# How an actuator goes from a state under a constant demand over a step: `Effect.respond` or `Effect.steer`.
Answer = Callable[[Tensor, Tensor, Tensor], Response]


class ThrustSignal:
    """Thrust in pieces: from each row on it goes from a state towards that row's demand.

    Before the first row the actuators are settled at its demand. Averages over a step are exact, wherever
    the pieces begin and end: a delay that is no multiple of the sampling interval keeps impulse and timing.

    Args:
        demand: (..., T, n), N, held from times[k] to times[k + 1].
        state: (..., T, n), N, as each piece begins; the demand itself where the actuators have no dynamics.
        times: (..., T), s, with the same leading shape.
        lag: how the actuators answer, where they have dynamics, or None.
    """

    def __init__(self, demand: Tensor, state: Tensor, times: Tensor, lag: Answer | None) -> None:
        """Keep the pieces; times in double precision, because differences of them are what counts."""
        self.demand, self.gap, self.lag = demand, state - demand, lag
        self.times = _rising(times.detach().double().expand(demand.shape[:-1]).contiguous())
        ends = torch.full_like(self.times[..., :1], torch.inf)
        self.ends = torch.cat([self.times[..., 1:], ends], dim=-1)

    def at(self, when: Tensor) -> Tensor:
        """Return the thrust (..., R, n) just after the moments `when` (..., R), s."""
        index = self._piece(when)
        since = (when - self._of(self.times, index)).clamp_min(0.0)
        value = self._of(self.demand, index)
        if self.lag is None:
            return value
        return value + self._of(self.gap, index) * self._left(since).end

    def piece(self, when: Tensor) -> Tensor:
        """Return which piece is under way at the moments `when` (...), for `along`."""
        return self._piece(when.unsqueeze(-1).to(self.times)).squeeze(-1)

    def along(self, piece: Tensor, when: Tensor) -> Tensor:
        """Return the thrust (..., n) at one moment each, (...), of a piece that goes on for ever."""
        index = piece.unsqueeze(-1)
        value = self._of(self.demand, index).squeeze(-2)
        if self.lag is None:
            return value
        since = (when.unsqueeze(-1) - self._of(self.times, index)).clamp_min(0.0)
        return value + (self._of(self.gap, index) * self._left(since).end).squeeze(-2)

    def over(self, begin: Tensor, length: Tensor, longest: float) -> tuple[Tensor, Tensor]:
        """Return mean and rise of the equivalent straight line over steps, (..., R, n) each.

        Args:
            begin: of the steps, s, (..., R).
            length: of the steps, s, (..., R), positive.
            longest: no step is longer than this, s.
        """
        # Ties between the ends of steps and pieces are the rule at a delay of zero: each is decided so that the
        # derivative is that of a delay that grows.
        first = self._piece(begin, after=False)
        end, middle = begin + length, begin + 0.5 * length
        impulse: Tensor | float = 0.0
        timing: Tensor | float = 0.0
        for count in range(self._most_pieces(longest)):
            index = (first + count).clamp_max(self.times.shape[-1] - 1)
            origin, last = self._of(self.times, index), self._of(self.ends, index)
            low = begin if count == 0 else origin
            high = torch.where(end <= last, end, last)
            covered = high >= low if count == 0 else (high > low) & (first + count < self.times.shape[-1])
            low, high = torch.where(covered, low, begin), torch.where(covered, high, begin)
            area_high, lean_high = self._since(index, high - origin)
            area_low, lean_low = self._since(index, low - origin)
            area = area_high - area_low
            shift = (origin - middle).unsqueeze(-1).to(area)
            impulse = impulse + area
            timing = timing + (lean_high - lean_low) + shift * area
        size = length.unsqueeze(-1).to(self.demand)
        return impulse / size, 12.0 * timing / (size * size)

    def _most_pieces(self, longest: float) -> int:
        reach = torch.searchsorted(self.times, self.times + longest * (1 + 1e-9), right=True)
        rows = torch.arange(self.times.shape[-1], device=self.times.device)
        return 1 if self.times.is_meta else int((reach - rows).max()) + 1

    def _piece(self, when: Tensor, after: bool = True) -> Tensor:
        found = torch.searchsorted(self.times, when.detach().double().contiguous(), right=after) - 1
        return found.clamp_min(0)

    @staticmethod
    def _of(values: Tensor, index: Tensor) -> Tensor:
        if values.dim() == index.dim():
            return torch.take_along_dim(values, index, dim=-1)
        return torch.take_along_dim(values, index.unsqueeze(-1), dim=-2)

    def _left(self, since: Tensor):
        assert self.lag is not None
        step = since.unsqueeze(-1).to(self.demand)
        one = torch.ones_like(step)
        return self.lag(one, torch.zeros_like(one), step)

    def _since(self, index: Tensor, since: Tensor) -> tuple[Tensor, Tensor]:
        """Return the integrals of the thrust, and of time since the piece began times thrust, up to `since`."""
        step = since.unsqueeze(-1).to(self.demand)
        mean = self._of(self.demand, index)
        lean: Tensor | float = 0.0
        if self.lag is not None:
            gap, left = self._of(self.gap, index), self._left(since.clamp_min(0.0))
            mean = mean + gap * left.mean
            lean = step * step * gap * left.slope / 12.0
        area = step * mean
        return area, 0.5 * step * area + lean


def _rising(times: Tensor) -> Tensor:
    """Return times (..., T) whose repeated last rows, the padding of a short window, go on rising."""
    steps = times[..., 1:] - times[..., :-1]
    if times.is_meta or times.shape[-1] < 2 or bool((steps > 0).all()):
        return times
    usual = steps.amax().clamp_min(1e-3)
    more = torch.cumsum(torch.where(steps > 0, torch.zeros_like(steps), usual), dim=-1)
    return torch.cat([times[..., :1], times[..., 1:] + more], dim=-1)
