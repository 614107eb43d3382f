"""From commands to thrust: static curves, allocation, and what the actuator effects make of it over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn

from auvnn.effects import Effect, Response
from auvnn.errors import ConfigError
from auvnn.models.actuation.thrust_signal import Answer, ThrustSignal
from auvnn.physics.thrusters import allocation_matrix, quadratic_thrust, table_thrust
from auvnn.vehicle import Vehicle


@dataclass(frozen=True)
class Drive:
    """The thrust over T rows' intervals, each cut into equal steps, N (or the wrench).

    Where an effect has the fins follow their commands, their actual angles, rad, come after the thrust: n is then the
    number of thrusters and fins together.

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


def _double(values: Any) -> Tensor:
    return torch.tensor(values, dtype=torch.float64)


class Actuators(nn.Module):
    """The thrusters of a vehicle, or a commanded wrench in their place.

    Args:
        vehicle: whose thrusters.
        actuation: "thrusters" or "wrench".
    """

    allocation: Tensor
    max_forward: Tensor
    max_reverse: Tensor

    def __init__(self, vehicle: Vehicle, actuation: str) -> None:
        """Collect geometry and curves.

        Raises:
            ConfigError: `actuation` is neither, or the vehicle has no thrusters.
        """
        super().__init__()
        if actuation not in ("thrusters", "wrench"):
            raise ConfigError(f"actuation={actuation!r} is unknown: choose thrusters or wrench")
        if actuation == "thrusters" and not vehicle.thrusters:
            raise ConfigError(
                f"{vehicle.name} has no thrusters in its model file: log tau_X ... tau_N instead"
            )
        self.actuation = actuation
        if actuation == "wrench":
            self.register_buffer("allocation", torch.eye(6, dtype=torch.float64))
            return
        units = vehicle.thrusters
        positions = _double([list(u.position) for u in units])
        directions = _double([list(u.direction) for u in units])
        self.register_buffer("allocation", allocation_matrix(positions, directions))
        self.register_buffer("max_forward", _double([float(u.max_forward) for u in units]))
        self.register_buffer("max_reverse", _double([float(u.max_reverse) for u in units]))
        self.tables: list[int] = []
        same: dict[tuple[float, ...], list[int]] = {}
        for index, unit in enumerate(units):
            curve = unit.curve
            if not isinstance(curve, str):
                self.tables.append(index)
                self.register_buffer(f"table_command_{index}", _double(list(curve.command)))
                self.register_buffer(f"table_thrust_{index}", _double(list(curve.thrust)))
                same.setdefault((*curve.command, *curve.thrust), []).append(index)
        # Thrusters that have the same table are looked up together.
        self.alike = list(same.values())

    @property
    def size(self) -> int:
        """Number of commands."""
        return self.allocation.shape[-1]

    def static(self, command: Tensor) -> Tensor:
        """Return the settled thrust of commands (..., n), N; a commanded wrench is its own."""
        if self.actuation == "wrench":
            return command
        thrust = quadratic_thrust(command, self.max_forward, self.max_reverse)
        for like in self.alike:
            grid, of = (getattr(self, f"table_{what}_{like[0]}") for what in ("command", "thrust"))
            looked_up = table_thrust(command[..., like], grid, of)
            thrust = thrust.index_copy(-1, torch.tensor(like, device=thrust.device), looked_up)
        return thrust

    def demand(self, command: Tensor, times: Tensor, effects: Sequence[Effect]) -> Tensor:
        """Return the settled thrust (..., T, n) of held commands, after the effects on commands.

        Args:
            command: held per interval, (..., T, n).
            times: of the rows, s, (..., T).
            effects: those on commands among them act.
        """
        for effect in effects:
            if "command" in effect.hooks():
                command = effect.command(command, times.to(command))
        return self.static(command)

    def signal(self, command: Tensor, times: Tensor, effects: Sequence[Effect]) -> ThrustSignal:
        """Return the thrust as a function of time, a delay left out; shapes as in `drive`.

        Args:
            command: held per interval, (..., T, n).
            times: of the rows, s, (..., T).
            effects: of the model that act on commands and thrust.
        """
        demand = self.demand(command, times, effects)
        lag = answer_of(effects, "respond")
        states = demand if lag is None else _states(demand, times, lag, 1)[0]
        return ThrustSignal(demand, states, times, lag)

    def steering(self, fins: Tensor | None, times: Tensor, effects: Sequence[Effect]) -> ThrustSignal | None:
        """Return the actual fin angles as a function of time; None where they are the commanded ones.

        Args:
            fins: commanded angles, held per interval, rad, (..., T, m), or None.
            times: of the rows, s, (..., T).
            effects: of the model.
        """
        steer = answer_of(effects, "steer")
        if steer is None or fins is None:
            return None
        return ThrustSignal(fins, _states(fins, times, steer, 1)[0], times, steer)

    def drive(
        self,
        command: Tensor,
        times: Tensor,
        effects: Sequence[Effect],
        substeps: int = 1,
        warmup: int = 0,
        fins: Tensor | None = None,
    ) -> Drive:
        """Work out the thrust over a stretch, after the effects on commands and the actuators' dynamics.

        The actuators are taken as settled at the first row, so that `warmup` rows of history before the
        stretch proper let them forget it.

        Args:
            command: (..., warmup + T, n); row k is held from times[k] to times[k + 1].
            times: (..., warmup + T), s.
            effects: in order of action.
            substeps: equal steps per interval.
            warmup: rows before the stretch.
            fins: commanded fin angles, rad, (..., warmup + T, m); where an effect has the fins follow them, the actual
                angles come after the thrust.

        Returns:
            The thrust over the T - 1 intervals of the stretch, and at its last row.
        """
        thrust = self._thrust(command, times, effects, substeps, warmup)
        steer = answer_of(effects, "steer")
        if steer is None or fins is None:
            return thrust
        angles = _lagged(fins, *_states(fins, times, steer, substeps), substeps, warmup)
        return _side_by_side(thrust, angles)

    def _thrust(
        self, command: Tensor, times: Tensor, effects: Sequence[Effect], substeps: int, warmup: int
    ) -> Drive:
        demand = self.demand(command, times, effects)
        lag, late = answer_of(effects, "respond"), _only(effects, "delay")
        if lag is None:
            rows = demand[..., warmup:, :]
            plain = Drive(rows.unsqueeze(-2), None, rows, substeps)
            states = demand
        else:
            states, answer = _states(demand, times, lag, substeps)
            plain = _lagged(demand, states, answer, substeps, warmup)
        if late is None:
            return plain
        signal = ThrustSignal(demand, states, times, lag)
        return _delayed(plain, signal, late.delay(), substeps, warmup)


def _only(effects: Sequence[Effect], hook: str) -> Effect | None:
    """Return the effect that has a hook which only one may have."""
    found = [e for e in effects if hook in e.hooks()]
    if len(found) > 1:
        names = " and ".join(e.name for e in found)
        raise ConfigError(f"{names} both give the actuators dynamics: keep one of them")
    return found[0] if found else None


def answer_of(effects: Sequence[Effect], hook: str) -> Answer | None:
    """Return how actuators answer ("respond") or fins ("steer"); None where no effect gives them dynamics.

    Raises:
        ConfigError: several do.
    """
    effect = _only(effects, hook)
    return None if effect is None else getattr(effect, hook)


def _side_by_side(thrust: Drive, angles: Drive) -> Drive:
    """Return thrust and fin angles as one, (..., n + m)."""
    assert angles.slopes is not None
    slopes = thrust.slopes
    if slopes is None:
        slopes = torch.zeros_like(thrust.means).expand(*thrust.means.shape[:-2], thrust.steps, -1)
    means = thrust.means.expand(slopes.shape)
    return Drive(
        torch.cat([means, angles.means], dim=-1),
        torch.cat([slopes, angles.slopes], dim=-1),
        torch.cat([thrust.starts, angles.starts], dim=-1),
        thrust.steps,
    )


def _states(demand: Tensor, times: Tensor, lag: Answer, substeps: int) -> tuple[Tensor, Response]:
    """Return the thrust as each row begins, (..., T, n), and the answer to a unit gap over each step."""
    # No interval follows the last row; its thrust is needed only at its very start.
    steps = torch.cat([times[..., 1:] - times[..., :-1], torch.zeros_like(times[..., :1])], dim=-1)
    h = steps.to(demand).unsqueeze(-1) / substeps
    # The answer is linear in the gap between state and demand: one call for all steps tells how the gap closes,
    # and the recursion in time is left with two operations a row.
    unit = torch.ones_like(h)
    answer = lag(unit, torch.zeros_like(h), h)
    rows = demand.unbind(-2)
    over = (answer.end**substeps).unbind(-2)
    state, states = rows[0], []
    for row, left in zip(rows, over, strict=True):
        states.append(state)
        state = row + (state - row) * left
    return torch.stack(states, dim=-2), answer


def _lagged(demand: Tensor, states: Tensor, answer: Response, substeps: int, warmup: int) -> Drive:
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


def _delayed(plain: Drive, signal: ThrustSignal, delay: Tensor, substeps: int, warmup: int) -> Drive:
    """Return the drive that comes `delay` seconds later; without delay it is `plain` to the last bit."""
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
