"""The thrust over every step of a stretch, and what the actuators' dynamics make of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from auvnn.effects import Response
from auvnn.models.actuation.thrust_signal import Answer, ThrustSignal
from auvnn.physics.recurrence import closing_gap


@dataclass(frozen=True)
class Drive:
    """The thrust over T rows' intervals, each cut into equal steps, N (or the wrench).

    Where an effect has the fins follow their commands, or they change within an interval, their actual angles, rad, come
    after the thrust, and last, where asked for, the propellers' speed as a command: n is the number of them all.

    Attributes:
        means: average thrust over each step, (..., T, steps, n), or (..., T, 1, n) where all steps have the same.
        slopes: rise of the equivalent straight line over each step, or None where the thrust is constant.
        starts: thrust just after the interval began, (..., T, n): what an accelerometer sees there.
        steps: per interval.
    """

    means: Tensor
    slopes: Tensor | None
    starts: Tensor
    steps: int

    @property
    def mean(self) -> list[list[Tensor]]:
        """Average thrust, [interval][step], (..., n): views, so that a loop need not index."""
        if self.means.shape[-2] == 1:
            return [[row] * self.steps for row in self.means.squeeze(-2).unbind(-2)]
        return [list(row.unbind(-2)) for row in self.means.unbind(-3)]

    @property
    def slope(self) -> list[list[Tensor]] | None:
        """Slopes, [interval][step], or None."""
        return None if self.slopes is None else [list(row.unbind(-2)) for row in self.slopes.unbind(-3)]

    @property
    def start(self) -> list[Tensor]:
        """Thrust as each interval begins, [interval]."""
        return list(self.starts.unbind(-2))


def side_by_side(thrust: Drive, more: Drive) -> Drive:
    """Return thrust and what acts beside it as one, (..., n + m)."""
    both = (thrust, more)
    straight = any(x.slopes is not None for x in both)
    slopes = [torch.zeros_like(x.means) if x.slopes is None else x.slopes for x in both]
    steps = max(x.shape[-2] for x in (*slopes, thrust.means, more.means))

    def joined(parts: Sequence[Tensor]) -> Tensor:
        return torch.cat([x.expand(*x.shape[:-2], steps, -1) for x in parts], dim=-1)

    return Drive(
        joined([x.means for x in both]),
        joined(slopes) if straight else None,
        torch.cat([x.starts for x in both], dim=-1),
        thrust.steps,
    )


def states_of(demand: Tensor, times: Tensor, lag: Answer, substeps: int) -> tuple[Tensor, Response]:
    """Return the thrust as each row begins, (..., T, n), and the answer to a unit gap over each step.

    Args:
        demand: held per interval, (..., T, n).
        times: of the rows, s, (..., T).
        lag: how it answers.
        substeps: equal steps per interval.
    """
    # No interval follows the last row; its thrust is needed only at its very start.
    steps = torch.cat([times[..., 1:] - times[..., :-1], torch.zeros_like(times[..., :1])], dim=-1)
    h = steps.to(demand).unsqueeze(-1) / substeps
    # The answer is linear in the gap between state and demand: one call for all steps tells how the gap closes.
    unit = torch.ones_like(h)
    answer = lag(unit, torch.zeros_like(h), h)
    return demand + closing_gap(demand, (answer.end**substeps)[..., :-1, :]), answer


def lagged(demand: Tensor, states: Tensor, answer: Response, substeps: int, warmup: int) -> Drive:
    """Return what follows its demand, from what it is as each row begins and the answer to a unit gap over a step.

    Args:
        demand: held per interval, (..., warmup + T, n).
        states: as each row begins, the same.
        answer: to a unit gap over a step.
        substeps: equal steps per interval.
        warmup: rows before the stretch.
    """
    gap = (states - demand)[..., warmup:, :]
    demand = demand[..., warmup:, :]
    end, mean, slope, start = (
        x[..., warmup:, :] for x in (answer.end, answer.mean, answer.slope, answer.start)
    )
    means, slopes = [], []
    for part in range(substeps):
        now = gap * end**part
        means.append(demand + now * mean)
        slopes.append(now * slope)
    return Drive(torch.stack(means, dim=-2), torch.stack(slopes, dim=-2), demand + gap * start, substeps)


def delayed(plain: Drive, signal: ThrustSignal, delay: Tensor, substeps: int, warmup: int) -> Drive:
    """Return the drive that comes `delay` seconds later; without delay it is `plain` to the last bit.

    Args:
        plain: without it.
        signal: thrust as a function of time.
        delay: s.
        substeps: equal steps per interval.
        warmup: rows before the stretch.
    """
    times = signal.times[..., warmup:]
    rows = times.shape[-1]
    steps = times[..., 1:] - times[..., :-1]
    # The last row is held for no time: a step like the one before stands in for it.
    last = steps[..., -1:] if rows > 1 else torch.ones_like(times)
    steps = torch.cat([steps, last], dim=-1) / substeps
    begin = times.unsqueeze(-1) + steps.unsqueeze(-1) * torch.arange(substeps, device=times.device)
    begin, length = begin.flatten(-2), steps.repeat_interleave(substeps, dim=-1)
    longest = 1.0 if times.is_meta else float(steps.max())
    late = delay.to(times)
    mean, slope = signal.over(begin - late, length, longest)
    # The same sums without delay take away their own rounding, so that a delay of zero changes nothing at all.
    mean_now, slope_now = signal.over(begin, length, longest)
    means = plain.means + (mean - mean_now).unflatten(-2, (rows, substeps))
    slopes = (slope - slope_now).unflatten(-2, (rows, substeps))
    if plain.slopes is not None:
        slopes = slopes + plain.slopes
    start = torch.where(late > 0, signal.at(times - late), plain.starts)
    return Drive(means, slopes, start, substeps)
