"""What the hooks of effects are given and return: parameters, the body, the moment, sensors, actuators."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from auvnn.errors import ConfigError

Array = NDArray[np.float64]
# Stands for every actuator, each by itself.
EACH = -1


@dataclass(frozen=True)
class Parameter:
    """One physical parameter of an effect.

    Attributes:
        name: as in the public contract.
        unit: SI; "1" for a pure number.
        null: the value at which the effect vanishes exactly (all parameters at their null).
        scale: a plausible size of the departure from the null: the prior's standard deviation.
        low: smallest admissible value.
        high: largest admissible value.
        probes: values at which to linearise instead, where the slope at the null says nothing.
        shape: whether it says how the effect acts and not how much (an onset, a frequency, a place): with all
            others at their nulls the effect vanishes whatever its value, so that nothing tells it there.
        timing: whether it says how long after its sample a command acts, s. When within an interval a command was given
            is not in a log: an interval's standard deviation is part of its standard error.
        actuator: of the effects on commands and on how thrust and fins follow them: the number of the only actuator on
            which it acts, or `EACH` where it acts on each by itself. None where what one actuator does depends on the
            commands of others, or where this is not known; slopes then take longer.
        of: the amount that a shape belongs to, where without it the shape says nothing though other amounts are not null.
    """

    name: str
    unit: str
    null: float
    scale: float
    low: float
    high: float
    probes: tuple[float, ...] = ()
    shape: bool = False
    timing: bool = False
    actuator: int | None = None
    of: str = ""

    def checked(self, effect: str, value: Any) -> float:
        """Return a value that was given for the parameter of an effect.

        Raises:
            ConfigError: it is no number, or out of bounds.
        """
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ConfigError(f"{effect}.{self.name} must be a number, not {value!r}")
        if not self.low <= value <= self.high:
            raise ConfigError(
                f"{effect}.{self.name} = {value:g} {self.unit} is out of bounds: "
                f"choose from {self.low:g} to {self.high:g}"
            )
        return float(value)


@dataclass(frozen=True)
class Unexplained:
    """What a fit leaves of the acceleration along the measured motion, N moments of all runs.

    Attributes:
        time: since the start of the run, s, (N,).
        position: NED, m, (N, 3).
        acceleration: of the body's origin in NED axes, m/s2, (N, 3).
    """

    time: Array
    position: Array
    acceleration: Array


@dataclass(frozen=True)
class Extent:
    """How far a log reaches: what the starting values of shapes depend on.

    Attributes:
        begin: earliest time, s.
        duration: from there to the latest time, s.
        longest: duration of the longest run, s.
        distance: median and largest distance from the origin of the positions, m; zeros without positions.
        runs: first and last time of each run, s; empty where all of the duration was recorded.
        left: what a fit leaves of the acceleration; None where that is not known.
    """

    begin: float
    duration: float
    longest: float
    distance: tuple[float, float] = (0.0, 0.0)
    runs: tuple[tuple[float, float], ...] = ()
    left: Unexplained | None = field(default=None, compare=False)

    def unseen(self) -> Extent:
        """Return it without what a fit leaves."""
        return replace(self, left=None)

    def recorded(self) -> list[tuple[float, float]]:
        """Return the stretches of time that at least one run has recorded, s, in order and without overlap."""
        if not self.runs:
            return [(self.begin, self.begin + self.duration)]
        joined: list[tuple[float, float]] = []
        for low, high in sorted(self.runs):
            if joined and low <= joined[-1][1]:
                joined[-1] = (joined[-1][0], max(joined[-1][1], high))
            else:
                joined.append((low, high))
        return joined

    def moment(self, share: float) -> float:
        """Return the time, s, before which lies a share, 0 to 1, of what was recorded: never between two dives."""
        stretches = self.recorded()
        left = share * self.seconds()
        for low, high in stretches:
            if left <= high - low:
                return low + left
            left -= high - low
        return stretches[-1][1]

    def seconds(self) -> float:
        """Return how long at least one run was recorded, s."""
        return sum(high - low for low, high in self.recorded())


@dataclass(frozen=True)
class Body:
    """What the body is at one moment; tensors in SI, leading shapes broadcast against the state's.

    Attributes:
        mass: kg.
        weight: N.
        buoyancy: N.
        cg: centre of gravity from the body origin, m, (..., 3).
        cb: centre of buoyancy, m, (..., 3).
        inertia: about the centre of gravity, kg m2, (..., 3, 3).
        added_mass: (..., 6, 6), positive for ordinary bodies.
        linear: linear damping, (..., 6, 6), or None.
        quadratic: quadratic damping, (..., 6, 6), or None.
        element_linear: linear coefficients of displaced elements, (..., e, 6), or None.
        element_quadratic: quadratic coefficients of displaced elements, (..., e, 6), or None.
        weight_centre: where the weight acts, m, (..., 3), where that is not the centre of gravity: mass that weighs
            nothing in water moves the one and not the other. None is the centre of gravity.
    """

    mass: Tensor
    weight: Tensor
    buoyancy: Tensor
    cg: Tensor
    cb: Tensor
    inertia: Tensor
    added_mass: Tensor
    linear: Tensor | None
    quadratic: Tensor | None
    element_linear: Tensor | None
    element_quadratic: Tensor | None
    weight_centre: Tensor | None = None

    @property
    def hangs(self) -> Tensor:
        """Where the weight acts, m, (..., 3)."""
        return self.cg if self.weight_centre is None else self.weight_centre

    def hung(self, weight: Tensor, at: Tensor) -> Body:
        """Return the same body with a further weight, N, that acts at a point, m, (..., 3)."""
        total = self.weight + weight
        centre = self.hangs + (weight / total).unsqueeze(-1) * (at - self.hangs)
        return replace(self, weight=total, weight_centre=centre)

    def but(self, **changes: Tensor) -> Body:
        """Return the same body with some of its properties changed."""
        return replace(self, **changes)


@dataclass(frozen=True)
class FinLift:
    """How the fins lift: what effects on fins change, each after the other.

    Attributes:
        angles: of the fins, rad, (..., m).
        share: of each fin's area that lifts, broadcast to (..., m).
        stall: factor on the angles at which the fins stall.
        sharpness: factor on how abruptly they do.
        separated: factor on the lift of the separated flow.
        crossflow: lift of the flow around the tips, 1/rad^2.
    """

    angles: Tensor
    share: Tensor | float = 1.0
    stall: Tensor | float = 1.0
    sharpness: Tensor | float = 1.0
    separated: Tensor | float = 1.0
    crossflow: Tensor | float = 0.0


@dataclass(frozen=True)
class Moment:
    """What a hook may know of the moment: state and inputs, (..., size) in SI, NED and FRD.

    Attributes:
        time: s since the start of the run, (...).
        position: NED, m, (..., 3).
        rotation: body to NED, (..., 3, 3).
        nu: velocity of the body origin over ground, (..., 6).
        nu_r: velocity through the water, as everything except the drag feels it, (..., 6); equal to `nu` inside `water`.
        dragged: the same as the drag feels it, (..., 6), where an effect sets it apart; None is `nu_r`.
        nu_c_dot: acceleration of the water in body axes, (..., 6); zero inside `water`.
        command: what was commanded over this interval, (..., n).
        speed: of the propellers, as the command that it settles at, (..., n), where an effect has it follow its command.
        fins: fin angles, rad, (..., m), or None; where an effect has the fins follow their commands, the actual ones.
        voltage: V, (...), or None.
        altitude: m, (...), or None.
        thrust: what the actuators give, N (or the wrench, where it is commanded), (..., n); in `wrench` only.
        drag: everything that resists motion through the water, damping subnetworks included, as a wrench on
            the body, N and N m, (..., 6); in `wrench` only.
        fin_lift: how the fins lift with the effects before this one; None as stated. In `wrench` only.
        body_lift: the hull's lift as it was added before, N and N m, (..., 6), or None. In `wrench` only.
        lift_lost: share of the hull's lift that is lost, (...), where an earlier effect says so. In `wrench` only.
    """

    time: Tensor
    position: Tensor
    rotation: Tensor
    nu: Tensor
    nu_r: Tensor
    nu_c_dot: Tensor
    command: Tensor
    fins: Tensor | None = None
    voltage: Tensor | None = None
    altitude: Tensor | None = None
    thrust: Tensor | None = None
    drag: Tensor | None = None
    fin_lift: FinLift | None = None
    dragged: Tensor | None = None
    body_lift: Tensor | None = None
    lift_lost: Tensor | None = None
    speed: Tensor | None = None

    @property
    def turning(self) -> Tensor:
        """Speed of the propellers as a command, (..., n): the command itself where nothing lags."""
        return self.command if self.speed is None else self.speed

    @property
    def drag_flow(self) -> Tensor:
        """Velocity through the water as the drag feels it, (..., 6)."""
        return self.nu_r if self.dragged is None else self.dragged


@dataclass(frozen=True)
class Sensed:
    """What sensors report, (..., size): position NED m, quaternion, velocity, its derivative or None."""

    position: Tensor
    quaternion: Tensor
    nu: Tensor
    nu_dot: Tensor | None = None


@dataclass(frozen=True)
class Response:
    """An actuator's answer to a constant demand over one step, N (of a fin rad), (..., n) each.

    Attributes:
        end: thrust at the end of the step.
        mean: its average over the step.
        slope: rise over the step of the straight line with the same mean and first moment, so that an
            integrator that sees only this line gets impulse and timing right, however short the lag.
        start: thrust just after the step began.
    """

    end: Tensor
    mean: Tensor
    slope: Tensor
    start: Tensor
