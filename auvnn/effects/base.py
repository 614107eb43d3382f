"""What an effect is: physical parameters, a null at which it vanishes, and the hooks by which it acts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from auvnn.catalogue import unknown_name
from auvnn.effects.hooks import Body, Extent, Moment, Parameter, Response, Sensed
from auvnn.errors import ConfigError

AXES = ("X", "Y", "Z", "K", "M", "N")
# Standard deviation, in scales, of a parameter that is stated to be exact: unlike zero, it can be divided by.
EXACT = 1e-6


class Effect(nn.Module):
    """A physical cause: an `nn.Module` whose parameters are physical, in SI units.

    A member overrides the hooks that it touches and leaves the rest alone; a hook left alone costs nothing. With every
    parameter at its null an effect must vanish exactly, so that "is it missing?" is one question for all of them.

    Hooks, along the signal path:
        `command`: the commands of a whole stretch, before the thruster curves (dead band).
        `delay`, `respond`, `steer`: how late thrust comes, its lag, that of fin angles; at most one effect each.
        `thrust`: the thrust of each actuator (gain, voltage, loss by inflow).
        `water`: velocity and acceleration of the water, NED.
        `flow`: how much of the water's motion everything except the drag feels.
        `body`: mass, centres, inertia, added mass, buoyancy, damping coefficients.
        `wrench`: any further force and moment on the body.
        `sense`: what the sensors make of the state.

    `plainer` names effects that explain the same trace more plainly wherever a log does not reach far enough to tell
    them apart: a current that is the same at all depths, where the depth hardly changes. The effect is then given as one
    of a group, never alone. `contains`: plainer effects that it is at some values, each with the parameters they share.
    `leaves`: effects that look like what its own form gets wrong. `remembers`: what `command` returns depends on earlier
    commands by one state per command: `follow`, `advance`. `acts_with`: effects without any of which it does nothing, so
    that it can neither be missing nor be hidden alone. `is_drag`: what it adds grows with the drag that others scale.
    `scales`: its `body` multiplies the vehicle's own numbers, and acts before what others add to them. `turns`: what
    `command` returns is the propellers' speed as a command; `by_speed`: its `thrust` goes by that speed.
    """

    name: ClassVar[str]
    cause: ClassVar[str]
    symbol: ClassVar[str]
    reference: ClassVar[str]
    channels: ClassVar[tuple[str, ...]] = ()
    excludes: ClassVar[tuple[str, ...]] = ()
    # Parameters of shape in which the effect is linear while it is small, and those that act on these levers.
    levers: ClassVar[tuple[str, ...]] = ()
    carried: ClassVar[tuple[str, ...]] = ()
    # For people: effects that leave a similar trace, and the manoeuvre (configs/excitation) that tells them apart.
    confused_with: ClassVar[tuple[str, ...]] = ()
    manoeuvre: ClassVar[str] = ""
    told_apart_by: ClassVar[str] = ""
    plainer: ClassVar[tuple[str, ...]] = ()
    contains: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    time_varying: ClassVar[bool] = False
    remembers: ClassVar[bool] = False
    turns: ClassVar[bool] = False
    by_speed: ClassVar[bool] = False
    leaves: ClassVar[tuple[str, ...]] = ()
    acts_with: ClassVar[tuple[str, ...]] = ()
    is_drag: ClassVar[bool] = False
    scales: ClassVar[bool] = False

    theta: nn.Parameter
    uncertainty: dict[str, float]  # standard deviations; of what is not in it the default holds

    def __init__(self, parameters: tuple[Parameter, ...], values: Mapping[str, float] | None = None) -> None:
        """Keep the parameters' descriptions and start them at `values`, the rest at their nulls.

        Raises:
            ConfigError: a name is unknown, or a value is no number or out of bounds.
        """
        super().__init__()
        self.parameters_of, self.uncertainty = parameters, {}
        self._index = {p.name: i for i, p in enumerate(parameters)}
        start = [p.null for p in parameters]
        for key, value in (values or {}).items():
            if key not in self._index:
                raise ConfigError(unknown_name(f"parameter of {self.name}", key, self._index))
            start[self._index[key]] = parameters[self._index[key]].checked(self.name, value)
        self.theta = nn.Parameter(torch.tensor(start, dtype=torch.float64))

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return the parameters that the effect has on this vehicle, driven by "thrusters" or "wrench"."""
        raise TypeError(f"{cls.__name__} does not describe its parameters")

    @classmethod
    def build(cls, vehicle: Any, actuation: str, values: Mapping[str, float] | None = None) -> Effect:
        """Make the effect for a vehicle, at `values` and otherwise at the null.

        Args:
            vehicle: the known numbers.
            actuation: "thrusters" or "wrench".
            values: parameters by name, SI units; those that are not given are at their nulls.
        """
        effect = cls(cls.describe(vehicle, actuation), values)
        effect.settle(vehicle, actuation)
        return effect

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep (see `keep`) what the hooks need to know of the vehicle."""

    def keep(self, name: str, value: Any) -> None:
        """Keep known numbers as a buffer: they follow dtype and device, and are not part of the state."""
        number = torch.tensor(np.array(value, dtype=np.float64))
        self.register_buffer(name, number, persistent=False)

    def kept(self, name: str) -> Tensor:
        """Return a buffer."""
        return self.get_buffer(name)

    @classmethod
    def lacks(cls, vehicle: Any, actuation: str) -> tuple[str, ...]:
        """Return what a vehicle's model file does not state and the effect cannot do without, in words."""
        return ()

    @classmethod
    def starts(cls, parameters: tuple[Parameter, ...], extent: Extent) -> list[dict[str, float]]:
        """Return values of shape parameters at which to ask whether the effect is there; by default the nulls.

        At each of them the effect must still vanish exactly while all other parameters are at their nulls.
        The test is corrected for taking the best of them.
        """
        return [{}]

    @classmethod
    def closest(
        cls, parameters: tuple[Parameter, ...], extent: Extent, shape: dict[str, float], level: int
    ) -> list[dict[str, float]]:
        """Return shapes around the best one that a closer look has found, to look again: level 0, then 1, and so on.

        Asked for until the list is empty, which it is by default. An onset or a frequency that is off by more than the
        errors can tell ends in another local minimum, out of which no fit gets.

        Args:
            parameters: of the effect, as `describe` returns them.
            extent: how far the log reaches in time and space.
            shape: the best one so far, parameters of shape by name.
            level: how often has been looked closer before.
        """
        return []

    @classmethod
    def happens(cls, values: Mapping[str, float], extent: Extent) -> bool:
        """Whether what the values say happens while something is recorded; by default it does.

        For effects that begin at some time: what was there before changes nothing, and has other names.

        Args:
            values: of all parameters, by name.
            extent: how far the log reaches in time and space.
        """
        return True

    @classmethod
    def told(cls, values: dict[str, float]) -> dict[str, float]:
        """Return the values by which people would state the same effect; the ones given, by default.

        For effects that are the same at several values: an angle that has gone round, a sign that another one undoes.
        """
        return dict(values)

    def value(self, name: str) -> Tensor:
        """Return one parameter as a scalar tensor."""
        return self.theta[self._index[name]]

    def state_uncertainty(self, given: Mapping[str, Any]) -> None:
        """Keep the standard deviations of some parameters, in their units.

        Raises:
            ConfigError: a name is unknown, or a value is not a number of at least zero.
        """
        for key, value in given.items():
            if key not in self._index:
                raise ConfigError(unknown_name(f"parameter of {self.name}", str(key), self._index))
            good = (
                isinstance(value, (int, float))
                and not isinstance(value, bool)
                and 0.0 <= value < float("inf")
            )
            if not good:
                raise ConfigError(
                    f"{self.name}.uncertainty.{key} = {value!r}: a standard deviation, a number from 0 up, is needed"
                )
            self.uncertainty[str(key)] = float(value)

    def standard_deviations(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Return how uncertain each parameter is, (p,): as stated, else a tenth of its value or of its scale.

        The larger of the two; a parameter that is stated to be exact keeps a millionth of its scale.
        """
        out = []
        for p, value in self.values().items():
            scale = self.parameters_of[self._index[p]].scale
            out.append(max(self.uncertainty.get(p, max(0.1 * abs(value), 0.1 * scale)), EXACT * scale))
        return np.array(out)

    def absent(self) -> bool:
        """Return whether the effect is at its null, whatever its shape, and so does nothing."""
        return all(
            p.shape or v == p.null for p, v in zip(self.parameters_of, self.theta.tolist(), strict=True)
        )

    def words(self) -> str:
        """Return what the effect has to say about itself once it is fitted, beyond its parameters; or nothing."""
        return ""

    def values(self) -> dict[str, float]:
        """Return the parameters by name."""
        return {p.name: float(v) for p, v in zip(self.parameters_of, self.theta.detach(), strict=True)}

    @classmethod
    def hooks(cls) -> tuple[str, ...]:
        """Return the names of the hooks that the effect overrides."""
        return tuple(h for h in HOOKS if getattr(cls, h) is not getattr(Effect, h))

    def command(self, command: Tensor, times: Tensor) -> Tensor:
        """Change the commands of a stretch: (..., T, n) held from `times` (..., T), to the same shape."""
        return command

    def follow(self, state: Tensor, command: Tensor) -> tuple[Tensor, Tensor]:
        """Return the changed command and the rate of the state, (..., n) each; settled, the state is the command."""
        return command, torch.zeros_like(state)

    def advance(self, state: Tensor, command: Tensor, step: Tensor) -> tuple[Tensor, Tensor]:
        """Return the changed command, its mean while one is held for `step` seconds (..., 1), and the state after.

        Args:
            state: of the effect before, (..., n).
            command: that is held, (..., n).
            step: for how long, s, (..., 1).
        """
        return command, state

    def delay(self) -> Tensor:
        """Return by how many seconds the thrust comes after its command, a scalar, not negative."""
        return torch.zeros_like(self.theta[0])

    def respond(self, state: Tensor, demand: Tensor, step: Tensor) -> Response:
        """Return how the thrust goes from `state` under a constant demand over `step` seconds, (..., n).

        The answer must be linear in the gap: demand + (state - demand) f(step) for `end`, `mean` and `start`,
        (state - demand) f(step) for `slope`; long stretches are worked out from f alone.

        Args:
            state: thrust at the start, N, (..., n).
            demand: thrust that is asked for, N, (..., n).
            step: for how long, s, broadcast against both.
        """
        return Response(demand, demand, torch.zeros_like(demand), demand)

    def steer(self, state: Tensor, command: Tensor, step: Tensor) -> Response:
        """Return how fin angles go from `state` under constant commands; what must be linear is as in `respond`.

        Args:
            state: angles at the start, rad, (..., m).
            command: angles that are asked for, rad, (..., m).
            step: for how long, s, broadcast against both.
        """
        return Response(command, command, torch.zeros_like(command), command)

    def thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        """Change the actuators' thrust, N (or the wrench, where it is commanded), (..., n)."""
        return thrust

    def water(self, moment: Moment) -> tuple[Tensor, Tensor]:
        """Return velocity m/s and acceleration m/s2 of the water, NED, (..., 3) each."""
        zero = torch.zeros_like(moment.position)
        return zero, zero

    def flow(self, moment: Moment) -> Moment:
        """Return the moment with the water's motion as everything except the drag feels it."""
        return moment

    def body(self, body: Body, moment: Moment | None) -> Body:
        """Change the body; `moment` is None unless the class is `time_varying`."""
        return body

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return a further wrench on the body, N and N m, about the body origin, (..., 6)."""
        return torch.zeros_like(moment.nu)

    def onward(self, moment: Moment) -> Moment:
        """Return the moment for the `wrench` of effects after this one; those on fins change it."""
        return moment

    def sense(self, sensed: Sensed) -> Sensed:
        """Turn what is into what the sensors report."""
        return sensed


HOOKS = ("command", "delay", "respond", "steer", "thrust", "water", "flow", "body", "wrench", "sense")
