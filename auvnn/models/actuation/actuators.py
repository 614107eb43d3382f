"""From commands to thrust: static curves, allocation, and what the actuator effects make of it over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from auvnn.effects import Effect
from auvnn.errors import ConfigError
from auvnn.models.actuation.drive import Drive, delayed, lagged, side_by_side, states_of
from auvnn.models.actuation.thrust_signal import Answer, ThrustSignal
from auvnn.physics.thrusters import allocation_matrix, quadratic_thrust, table_thrust
from auvnn.vehicle import Vehicle


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
        states = demand if lag is None else states_of(demand, times, lag, 1)[0]
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
        return ThrustSignal(fins, states_of(fins, times, steer, 1)[0], times, steer)

    def turned(self, command: Tensor, times: Tensor, effects: Sequence[Effect]) -> ThrustSignal:
        """Return the propellers' speed, as a command, as a function of time: its mean over each row.

        Args:
            command: held per interval, (..., T, n).
            times: of the rows, s, (..., T).
            effects: of the model.
        """
        rows = turning(command, times, effects)
        return ThrustSignal(rows, rows, times, None)

    def drive(
        self,
        command: Tensor,
        times: Tensor,
        effects: Sequence[Effect],
        substeps: int = 1,
        warmup: int = 0,
        fins: Tensor | None = None,
        within: Tensor | None = None,
        fins_within: Tensor | None = None,
        speeds: bool = False,
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
            fins: commanded fin angles, rad, (..., warmup + T, m); where an effect has the fins follow them, or they
                change within an interval, the actual angles come after the thrust.
            within: commands over equal parts of each interval, (..., warmup + T, parts, n), see `Inputs`. They stand for
                `command` where each part is a whole number of steps.
            fins_within: fin angles over the same parts, rad, (..., warmup + T, parts, m).
            speeds: whether the propellers' speed, as a command, comes after it (see `speeds_follow`).

        Returns:
            The thrust over the T - 1 intervals of the stretch, and at its last row.
        """
        rows = (times, effects, substeps, warmup)
        thrust = _by_parts(self._thrust, command, within, *rows)
        steer = answer_of(effects, "steer")
        if fins is not None and (
            steer is not None or (fins_within is not None and substeps % fins_within.shape[-2] == 0)
        ):
            thrust = side_by_side(thrust, _by_parts(_angles, fins, fins_within, *rows))
        return side_by_side(thrust, _by_parts(_speeds, command, within, *rows)) if speeds else thrust

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
            states, answer = states_of(demand, times, lag, substeps)
            plain = lagged(demand, states, answer, substeps, warmup)
        if late is None:
            return plain
        signal = ThrustSignal(demand, states, times, lag)
        return delayed(plain, signal, late.delay(), substeps, warmup)


def _angles(fins: Tensor, times: Tensor, effects: Sequence[Effect], substeps: int, warmup: int) -> Drive:
    """Return fin angles, as they are commanded or as an effect has them follow."""
    steer = answer_of(effects, "steer")
    if steer is None:
        rows = fins[..., warmup:, :]
        return Drive(rows.unsqueeze(-2), None, rows, substeps)
    return lagged(fins, *states_of(fins, times, steer, substeps), substeps, warmup)


def turning(command: Tensor, times: Tensor, effects: Sequence[Effect]) -> Tensor:
    """Return the propellers' mean speed over each row, as the command that it settles at, (..., T, n).

    It is that of the command as given: what other effects make of commands is about the thrust.

    Args:
        command: held per interval, (..., T, n).
        times: of the rows, s, (..., T).
        effects: of the model.
    """
    for effect in effects:
        if effect.turns:
            command = effect.command(command, times.to(command))
    return command


def _speeds(command: Tensor, times: Tensor, effects: Sequence[Effect], substeps: int, warmup: int) -> Drive:
    rows = turning(command, times, effects)[..., warmup:, :]
    return Drive(rows.unsqueeze(-2), None, rows, substeps)


def _by_parts(
    work: Callable[[Tensor, Tensor, Sequence[Effect], int, int], Drive],
    held: Tensor,
    within: Tensor | None,
    times: Tensor,
    effects: Sequence[Effect],
    substeps: int,
    warmup: int,
) -> Drive:
    """Return what becomes of values that are held for a row, or for a part of its interval: a row of its own then."""
    if within is None or substeps % within.shape[-2]:
        return work(held, times, effects, substeps, warmup)
    parts = within.shape[-2]
    steps = times[..., 1:] - times[..., :-1]
    # No interval follows the last row: its parts are as long as those before, as if the record went on.
    steps = torch.cat([steps, steps[..., -1:]], dim=-1) / parts
    fine = times.unsqueeze(-1) + steps.unsqueeze(-1) * torch.arange(parts, device=times.device)
    found = work(within.flatten(-3, -2), fine.flatten(-2), effects, substeps // parts, warmup * parts)
    rows = within.shape[-3] - warmup
    means = found.means.expand(*found.means.shape[:-2], substeps // parts, -1)
    return Drive(
        means.unflatten(-3, (rows, parts)).flatten(-3, -2),
        None if found.slopes is None else found.slopes.unflatten(-3, (rows, parts)).flatten(-3, -2),
        found.starts[..., ::parts, :],
        substeps,
    )


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
