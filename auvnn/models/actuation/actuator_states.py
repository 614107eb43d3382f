"""What the actuators remember, as a state: for continuous time, and for steps of one length in closed form."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from auvnn.effects import Effect
from auvnn.errors import ConfigError
from auvnn.models.actuation.acting import follow
from auvnn.models.actuation.actuators import Actuators, answer_of
from auvnn.models.actuation.thrust_signal import Answer
from auvnn.physics.thrusters import quadratic_thrust, summed_table_thrust

PADE = 3
"""States per actuator that stand for a delay in continuous time."""


class ActuatorStates(nn.Module):
    """The way from commands to thrust as first-order equations, one block of n numbers per kind of memory.

    In continuous time the state is [thrust before the delay (a lag) | one filter per effect on commands that
    remembers | three Padé states (a delay)]. The delay exp(-s d) is then (1 - 2/5 d s + 1/20 (d s)^2) / (1 + 3/5 d s +
    3/20 (d s)^2 + 1/60 (d s)^3), whose phase is right to 1 degree up to 2.4/d rad/s.

    For steps of a fixed length the state is [thrust before the delay | filters | settled thrust of the last rows], and
    lag, filter and delay are exact for commands that are held, as in a rollout.

    Where fins follow their commands with a lag, their actual angles are the first numbers of the state, either way; a
    command is then [commands of the thrusters | commanded fin angles], and what acts [thrust | fin angles]. Where the
    propellers' speed follows its command and losses by inflow go by it, it comes last among what acts; where other
    effects shape the command before, it is a block of its own after the filters.

    Reference: Franklin, Powell and Workman (1998), Digital Control of Dynamic Systems, section 4.3; for the Padé
    approximant Golub and Van Loan (2013), section 9.3.

    Args:
        actuators: thruster curves.
        effects: effects of the model, in order of action.
        dt: length of a step, s, for which a delay is kept; None for continuous time.
        fins: how many the vehicle has.

    Raises:
        ConfigError: an effect on commands remembers, but does not say how.
    """

    def __init__(
        self, actuators: Actuators, effects: list[Effect], dt: float | None = None, fins: int = 0
    ) -> None:
        """Find out what remembers."""
        super().__init__()
        self.actuators, self.dt = actuators, dt
        self.size = actuators.size
        self.shaping = [e for e in effects if "command" in e.hooks()]
        self.filters = [e for e in self.shaping if e.remembers]
        for effect in self.shaping:
            if not effect.remembers and _looks_back(effect, self.size):
                raise ConfigError(
                    f"effect {effect.name} remembers commands and does not say how: see Effect.follow"
                )
        # The effect whose state is the propellers' speed, where that acts by itself, and whether it is a further block.
        self.turning = next((e for e in self.shaping if e.turns), None) if follow(effects) else None
        self.apart = self.turning is not None and self.turning is not self.shaping[0]
        answer = answer_of(effects, "respond")
        self.rate_of_lag = None if answer is None else _decay(answer)
        self.lag = answer if self.rate_of_lag is not None else None
        answer = answer_of(effects, "steer") if fins else None
        self.rate_of_fins = None if answer is None else _decay(answer)
        self.steer = answer if self.rate_of_fins is not None else None
        # Fins whose angles are part of the state; others are where they are commanded.
        self.fins = fins if self.steer is not None else 0
        self.delay = max((float(e.delay().detach()) for e in effects if "delay" in e.hooks()), default=0.0)
        # Rows whose settled thrust is still on its way as a step begins, and the share of the step until the next.
        self.rows, self.share = 0, 0.0
        if self.delay > 0 and dt is not None:
            whole = self.delay / dt
            whole = round(whole) if abs(whole - round(whole)) < 1e-9 else whole
            self.rows, self.share = math.ceil(whole), whole - math.floor(whole)
        if self.rows > 1000:
            raise ConfigError(
                f"a delay of {self.delay:g} s is {self.rows} steps of {dt:g} s: give a longer step, up to 1000 are kept"
            )

    @property
    def states(self) -> int:
        """Numbers that are remembered."""
        late = 0 if not self.delay else (self.rows if self.dt is not None else PADE)
        return self.size * ((self.lag is not None) + len(self.filters) + self.apart + late) + self.fins

    @property
    def inputs(self) -> int:
        """Numbers in a command."""
        return self.size + self.fins

    @property
    def acting(self) -> int:
        """Numbers in what acts."""
        return self.inputs + (0 if self.turning is None else self.size)

    def names(self) -> list[str]:
        """Return one name per number of the state."""
        places = [f"tau_{a}" for a in "XYZKMN"] if self.actuators.actuation == "wrench" else None
        places = places or [f"thruster_{k + 1}" for k in range(self.size)]
        blocks = ["thrust"] if self.lag is not None else []
        blocks += [str(e.name) for e in self.filters] + ["speed"] * self.apart
        if self.delay:
            blocks += [f"delay_{k + 1}" for k in range(self.rows if self.dt is not None else PADE)]
        names = [f"{block}.{place}" for block in blocks for place in places]
        return [*(f"angle.fin_{k + 1}" for k in range(self.fins)), *names]

    def static(self, command: Tensor) -> Tensor:
        """Return the settled thrust of commands (..., n), N; tables as sums of kinks, without an index."""
        own = self.actuators
        if own.actuation == "wrench" or not own.tables:
            return own.static(command)
        columns = list(quadratic_thrust(command, own.max_forward, own.max_reverse).unbind(-1))
        for index in own.tables:
            grid, thrust = (own.get_buffer(f"table_{n}_{index}") for n in ("command", "thrust"))
            columns[index] = summed_table_thrust(command[..., index], grid, thrust)
        return torch.stack(columns, dim=-1)

    def settled(self, command: Tensor) -> Tensor:
        """Return the state (..., k) of actuators that have been at a command (..., n + m) for long."""
        command, angles = command.split((self.size, self.fins), dim=-1)
        shaped, filters = command, list[Tensor]()
        for effect in self.shaping:
            if effect.remembers:
                filters.append(shaped)
            else:
                shaped = _now(effect, shaped)
        thrust = self.static(shaped)
        parts = [thrust] if self.lag is not None else []
        parts += filters + [command] * self.apart
        if self.delay:
            parts += [thrust] * self.rows if self.dt is not None else [thrust, 0 * thrust, 0 * thrust]
        parts = [angles, *parts] if self.fins else parts
        return torch.cat(parts, dim=-1) if parts else command[..., :0]

    def rate(self, state: Tensor, command: Tensor) -> tuple[Tensor, Tensor]:
        """Return what acts (..., n + m + n), N and rad, and the rate of the state (..., k), in continuous time."""
        angles, state = state.split((self.fins, self.states - self.fins), dim=-1)
        command, wanted = command.split((self.size, self.fins), dim=-1)
        blocks = list(state.split(self.size, dim=-1)) if self.states > self.fins else []
        rates: list[Tensor] = []
        lagged = blocks.pop(0) if self.lag is not None else None
        given, speed = command, None
        for effect in self.shaping:
            if effect.remembers:
                command, rate = effect.follow(blocks.pop(0), command)
                rates.append(rate)
            else:
                command = _now(effect, command)
            speed = command if effect is self.turning else speed
        if self.apart and self.turning is not None:
            speed, rate = self.turning.follow(blocks.pop(0), given)
            rates.append(rate)
        thrust = self.static(command)
        if lagged is not None:
            assert self.rate_of_lag is not None
            rates.insert(0, self.rate_of_lag.to(thrust) * (thrust - lagged))
            thrust = lagged
        if self.delay:
            a, b, c = blocks
            rates += [b / self.delay, c / self.delay, (60 * (thrust - a) - 36 * b - 9 * c) / self.delay]
            thrust = a - 0.4 * b + 0.05 * c
        if self.fins:
            assert self.rate_of_fins is not None
            rates.insert(0, self.rate_of_fins.to(thrust) * (wanted - angles))
            thrust = torch.cat([thrust, angles], dim=-1)
        if speed is not None:
            thrust = torch.cat([thrust, speed], dim=-1)
        return thrust, torch.cat(rates, dim=-1) if rates else state

    def advance(
        self, state: Tensor, command: Tensor, step: Tensor, substeps: int = 1
    ) -> tuple[list[tuple[Tensor, Tensor | None]], Tensor]:
        """Hold a command (..., n + m) for one step.

        Args:
            state: (..., k).
            command: (..., n + m).
            step: its length, s, (..., 1); with a delay it must be `dt`.
            substeps: equal parts.

        Returns:
            Mean of what acts and rise of the equivalent line, (..., n + m + n) each, of every part (None where it is
            constant), and the state afterwards, (..., k).
        """
        angles, state = state.split((self.fins, self.states - self.fins), dim=-1)
        command, wanted = command.split((self.size, self.fins), dim=-1)
        blocks = list(state.split(self.size, dim=-1)) if self.states > self.fins else []
        filters: list[Tensor] = []
        thrust = blocks.pop(0) if self.lag is not None else None
        given, speed = command, None
        for effect in self.shaping:
            if effect.remembers:
                command, after = effect.advance(blocks.pop(0), command, step)
                filters.append(after)
            else:
                command = _now(effect, command)
            speed = command if effect is self.turning else speed
        if self.apart and self.turning is not None:
            speed, after = self.turning.advance(blocks.pop(0), given, step)
            filters.append(after)
        demand, coming = self.static(command), blocks
        # Oldest last: first what is left of the row under way, then the row after it.
        queue = [demand, *coming]
        demands = [(0.0, 1.0, queue[-1])]
        if self.share:
            demands = [(0.0, self.share, queue[-1]), (self.share, 1.0, queue[-2])]
        parts: list[tuple[Tensor, Tensor | None]] = []
        for k in range(substeps):
            begin, end = k / substeps, (k + 1) / substeps
            inside = [(max(a, begin), min(b, end), d) for a, b, d in demands if min(b, end) > max(a, begin)]
            parts.append(self._part(inside, begin, end, thrust, step))
            thrust = None if thrust is None else self._after(inside, thrust, step)
        left = ([] if thrust is None else [thrust]) + filters + (queue[: self.rows] if self.delay else [])
        if self.steer is not None:
            for k, (mean, rise) in enumerate(parts):
                turned = self.steer(angles, wanted, step / substeps)
                rise = torch.zeros_like(mean) if rise is None else rise
                parts[k] = (torch.cat([mean, turned.mean], dim=-1), torch.cat([rise, turned.slope], dim=-1))
                angles = turned.end
            left.insert(0, angles)
        if speed is not None:
            parts = [
                (
                    torch.cat([m, speed], dim=-1),
                    None if r is None else torch.cat([r, torch.zeros_like(speed)], dim=-1),
                )
                for m, r in parts
            ]
        return parts, torch.cat(left, dim=-1) if left else state

    def _part(
        self,
        inside: list[tuple[float, float, Tensor]],
        begin: float,
        end: float,
        thrust: Tensor | None,
        step: Tensor,
    ) -> tuple[Tensor, Tensor | None]:
        """Return mean and rise over a part of the step, from those of the pieces within it."""
        if len(inside) == 1 and thrust is None:
            return inside[0][2], None
        mean: Tensor | float = 0.0
        rise: Tensor | float = 0.0
        for a, b, demand in inside:
            width, middle = (b - a) / (end - begin), (0.5 * (a + b) - begin) / (end - begin) - 0.5
            own, lean = demand, None
            if thrust is not None and self.lag is not None:
                answer = self.lag(thrust, demand, (b - a) * step)
                own, lean, thrust = answer.mean, answer.slope, answer.end
            mean = mean + width * own
            rise = rise + 12.0 * width * middle * own
            if lean is not None:
                rise = rise + width * width * lean
        assert isinstance(mean, Tensor) and isinstance(rise, Tensor)
        return mean, rise

    def _after(self, inside: list[tuple[float, float, Tensor]], thrust: Tensor, step: Tensor) -> Tensor:
        assert self.lag is not None
        for a, b, demand in inside:
            thrust = self.lag(thrust, demand, (b - a) * step).end
        return thrust


def _now(effect: Effect, command: Tensor) -> Tensor:
    """Apply an effect on commands that remembers nothing to one row."""
    return effect.command(command.unsqueeze(-2), torch.zeros_like(command[..., :1])).squeeze(-2)


def _looks_back(effect: Effect, size: int) -> bool:
    """Return whether what an effect makes of a command depends on the commands before it."""
    with torch.no_grad():
        rows = torch.stack([torch.full((2, size), x, dtype=torch.float64) for x in (0.3, 0.5, 0.7)], dim=-2)
        rows[1, 0] = -0.4
        made = effect.command(rows, torch.tensor([0.0, 0.1, 0.2], dtype=torch.float64).expand(2, 3))
    return not torch.equal(made[0, 2], made[1, 2])


def _decay(lag: Answer) -> Tensor | None:
    """Return the rates at which the gap to the demand closes, 1/s; None where it is closed at once.

    A gap that closes in proportion to itself, whenever one looks, does so as exp(-rate t).
    """
    with torch.no_grad():
        one = torch.ones(1, dtype=torch.float64)
        step = 1e-3 * one
        for _ in range(3):
            left = lag(one, 0 * one, step).end
            if float(left.min()) <= 0.0:
                return None
            rate = -torch.log(left) / step
            step = 1.0 / rate.max() * one
        return rate
