"""A model made ready to leave: frozen, as first-order equations, and as graphs of scalar operations."""

from __future__ import annotations

import copy
import re
from functools import cached_property

import torch
from torch import Tensor, nn

from auvnn.errors import ConfigError
from auvnn.exports.graph import Graph, differentiated, traced
from auvnn.models import GreyBox
from auvnn.models.free_running.rate import SIZE, unit_attitude
from auvnn.models.linear.state_space import StateSpace

RESERVED = frozenset(
    (  # noqa: SIM905
        "auto break case char const continue default do double else enum extern float for goto if inline int long "
        "register restrict return short signed sizeof static struct switch typedef union unsigned void volatile "
        "while main"
    ).split()
)
"""Words that are no names in C."""


class System:
    """One model on its way out.

    Attributes:
        model: a copy whose numbers stand still.
        name: of functions and files: letters, digits and underscores.
        dt: length of a step, s, with which a delay is kept; other models take any.
        flow: the model in continuous time.
        steps: the model in steps.

    Args:
        model: the model.
        dt: see above.
        name: by default the vehicle's.

    Raises:
        ConfigError: the name is none, or the model cannot be written as first-order equations.
    """

    def __init__(self, model: GreyBox, dt: float, name: str | None = None) -> None:
        """Freeze a copy in double precision."""
        self.model = copy.deepcopy(model).double().cpu().eval().requires_grad_(False)
        self.name = identifier(model.vehicle.name) if name is None else name
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,60}", self.name) or self.name in RESERVED:
            raise ConfigError(
                f"name={self.name}: give a name of letters, digits and _, that starts with a letter"
            )
        self.dt = dt
        with torch.no_grad():
            self.flow, self.steps = StateSpace(self.model), StateSpace(self.model, dt)

    @property
    def delay(self) -> float:
        """The delay of the actuators, s; with one, steps are of length `dt`."""
        return self.flow.actuators.delay

    @cached_property
    def motion(self) -> Graph:
        """Rate (13) of y (13) under thrust (n), fin angles and speeds where they lag, u (m) at time t."""
        return traced(
            lambda y, thrust, u, t: self.flow.motion(y, thrust, u, t),
            {"y": self.sample("y"), "f": self.sample("f"), "u": self.sample("u"), "t": self.sample("t")},
        )

    @cached_property
    def actuator_rate(self) -> Graph:
        """Thrust (n), then the rate of the actuators' state a (k), of a and u."""
        return traced(
            lambda a, u: torch.cat(self.flow.actuators.rate(a, u[: self.flow.actuators.inputs]), dim=-1),
            {"a": self.sample("x")[SIZE:], "u": self.sample("u")},
        )

    @cached_property
    def actuator_step(self) -> Graph:
        """Mean thrust (n), its rise (n), and the actuators' state afterwards (k), of a, u and the step h."""
        return traced(
            self._advanced, {"a": self.sample("s")[SIZE:], "u": self.sample("u"), "h": self.sample("h")}
        )

    @cached_property
    def settled(self) -> Graph:
        """The settled states of the actuators, in continuous time and in steps, of u."""
        n = self.flow.actuators.inputs
        return traced(
            lambda u: torch.cat([s.actuators.settled(u[:n]) for s in (self.flow, self.steps)], dim=-1),
            {"u": self.sample("u")},
        )

    @cached_property
    def unit(self) -> Graph:
        """What is done to y after a step."""
        return traced(unit_attitude, {"y": self.sample("y")})

    @cached_property
    def rate(self) -> Graph:
        """Rate (n) of the whole state x in continuous time."""
        return traced(self.flow.rate, {"x": self.sample("x"), "u": self.sample("u"), "t": self.sample("t")})

    @cached_property
    def jacobian(self) -> Graph:
        """Slopes of the rate, row by row: in x (n, n), then in u (n, m)."""
        return differentiated(self.rate, ("x", "u"))

    def _advanced(self, a: Tensor, u: Tensor, h: Tensor) -> Tensor:
        own = self.steps.actuators
        [(mean, rise)], after = own.advance(a, u[: own.inputs], h.unsqueeze(-1))
        return torch.cat([mean, torch.zeros_like(mean) if rise is None else rise, after], dim=-1)

    def sample(self, name: str) -> Tensor:
        """Return one argument of a function, for tracing: its values do not matter."""
        return self.samples(1, seed=1)[name][0]

    def samples(self, count: int, seed: int) -> dict[str, Tensor]:
        """Return arguments as they may occur, (count, size) or (count): x, s, u, t, h, and of x the head y; thrust f."""
        generator = torch.Generator().manual_seed(seed)

        def draw(*shape: int) -> Tensor:
            return torch.randn(count, *shape, generator=generator, dtype=torch.float64)

        space, n = self.flow, self.flow.actuators.size
        eta = torch.cat([2.0 * draw(3), draw(4)], dim=-1)
        eta[:, 2] = eta[:, 2].abs() + 2.0
        y = unit_attitude(torch.cat([eta, 0.5 * draw(6)], dim=-1))
        scale = torch.tensor([40.0] * 3 + [8.0] * 3 if self.model.actuation == "wrench" else [0.5] * n)
        command, before = scale * draw(n), scale * draw(n)
        parts = [command, 0.2 * draw(space.fins)]
        parts += [15.0 + draw(1)] * space.voltage + [0.5 + 3.0 * draw(1).abs()] * space.altitude
        with torch.no_grad():
            thrust = self.flow.actuators.static(before)
            speed = before
            if self.flow.actuators.fins:
                turned = 0.2 * draw(space.fins)
                before, thrust = torch.cat([before, turned], dim=-1), torch.cat([thrust, turned], dim=-1)
            if self.flow.actuators.turning is not None:
                thrust = torch.cat([thrust, speed], dim=-1)
            a, b = (s.actuators.settled(before) for s in (self.flow, self.steps))
        # Away from where actuators are settled, by more than a little.
        a, b = (v + 0.3 * v * torch.randn(v.shape, generator=generator, dtype=torch.float64) for v in (a, b))
        h = 0.02 + 0.08 * torch.rand(count, generator=generator, dtype=torch.float64)
        return {
            "y": y, "x": torch.cat([y, a], dim=-1), "s": torch.cat([y, b], dim=-1), "u": torch.cat(parts, dim=-1),
            "t": 30.0 * torch.rand(count, generator=generator, dtype=torch.float64), "f": thrust,
            "h": torch.full_like(h, self.dt) if self.delay else h,
        }  # fmt: skip

    def lost(self) -> list[str]:
        """Return what no form of the equations of motion holds."""
        return [
            f"{e.name}: what sensors make of the state is no part of the equations of motion"
            for e in self.model.using("sense")
        ]

    def notes(self) -> list[str]:
        """Return what is approximate in them."""
        if not self.delay:
            return []
        return [
            f"actuation delay of {self.delay:g} s: exact in steps of {self.dt:g} s; in the state derivative a Padé "
            f"approximant, whose phase is right to 1 degree up to {2.4 / self.delay:.3g} rad/s"
        ]


class StepModule(nn.Module):
    """A step as a separate module, for formats that hold modules: forward(state, inputs, time, h)."""

    def __init__(self, space: StateSpace) -> None:
        super().__init__()
        self.space = space

    def forward(self, state: Tensor, inputs: Tensor, time: Tensor, h: Tensor) -> Tensor:
        """Return the state after h seconds.

        Args:
            state: (n,).
            inputs: held over the step, (m,).
            time: at its start, s, ().
            h: length of the step, s, ().
        """
        return self.space.step(state, inputs, time, h)


class RateModule(nn.Module):
    """The state derivative as a module: forward(state, inputs, time)."""

    def __init__(self, space: StateSpace) -> None:
        super().__init__()
        self.space = space

    def forward(self, state: Tensor, inputs: Tensor, time: Tensor) -> Tensor:
        """Return the rate of the state.

        Args:
            state: (n,).
            inputs: (m,).
            time: s, ().
        """
        return self.space.rate(state, inputs, time)


def identifier(name: str) -> str:
    """Return a vehicle's name as a name in code."""
    plain = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_")[:60]
    return plain if plain and plain[0].isalpha() and plain not in RESERVED else f"model_{plain}"[:60]
