"""What a world is: how commands, forces, drag, sensors and conventions depart from what a model assumes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

import numpy as np

from auvnn.catalogue import unknown_name
from auvnn.config import config_dir, read_yaml
from auvnn.errors import ConfigError


@dataclass(frozen=True)
class Disturbance:
    """An Ornstein-Uhlenbeck wrench in body axes.

    Attributes:
        share: its rms in each degree of freedom, as a share of the rms of the wrench that is commanded there.
        correlation: shortest and longest correlation time, s; drawn evenly in the logarithm for each degree of freedom.
    """

    share: float = 0.0
    correlation: tuple[float, float] = (0.5, 5.0)


@dataclass(frozen=True)
class Shape:
    """Laws of drag, thrust and lift that differ from the stated ones.

    Attributes:
        exponent: least and largest exponent of the quadratic drag; drawn evenly for each degree of freedom.
        thrust: largest error of the thrust curves, as a share; each actuator has its own.
        separation: share of the lift that has another form: a fin's stalls gently, a hull's fades broadside.
    """

    exponent: tuple[float, float] = (2.0, 2.0)
    thrust: float = 0.0
    separation: float = 0.0


@dataclass(frozen=True)
class Sensors:
    """What sensors do besides white noise.

    Attributes:
        correlation: correlation time of the noise, s; its size is that of the noise condition.
        outliers: share of samples that are off by many standard deviations, channel by channel.
        outlier_size: least and largest size of these, in standard deviations.
        dropouts: share of samples that are missing, by sensor: velocities, rates, attitude, position.
        velocity_rate: how often u, v and w are measured, Hz; in between, the last are repeated. Zero: at every row.
        tilt: angle by which the attitude's vertical is off, rad, to a random side.
        jitter: standard deviation of the time stamps' error, s.
    """

    correlation: float = 0.0
    outliers: float = 0.0
    outlier_size: tuple[float, float] = (8.0, 30.0)
    dropouts: float = 0.0
    velocity_rate: float = 0.0
    tilt: float = 0.0
    jitter: float = 0.0


@dataclass(frozen=True)
class Conventions:
    """Simplifications that are common in simulators.

    Attributes:
        added_coriolis: share of the Coriolis forces of the added mass that acts.
        relative: share of the water's motion that anything but the drag feels.
    """

    added_coriolis: float = 1.0
    relative: float = 1.0


@dataclass(frozen=True)
class World:
    """Departures from what models assume; without any, the usual world.

    Attributes:
        name: of the world.
        control_rate: how often the commands change, Hz; zero: at every row of the log.
        disturbance: a force that no equation has.
        shape: other laws of drag, thrust and lift.
        sensors: other errors than white noise.
        conventions: other equations.
        true_names: names of the catalogue that are true in it even with nothing hidden.
    """

    name: str = "custom"
    control_rate: float = 0.0
    disturbance: Disturbance = field(default_factory=Disturbance)
    shape: Shape = field(default_factory=Shape)
    sensors: Sensors = field(default_factory=Sensors)
    conventions: Conventions = field(default_factory=Conventions)
    true_names: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the world as plain data."""
        return asdict(self)

    def every(self, rate: float) -> int:
        """Return how many changes of the commands there are from row to row of a log.

        Raises:
            ConfigError: the rates do not fit.
        """
        if self.control_rate <= 0.0:
            return 1
        times = self.control_rate / rate
        if times < 1.0 or abs(times - round(times)) > 1e-9 * times:
            raise ConfigError(
                f"rate = {rate:g}: world {self.name} changes commands at {self.control_rate:g} Hz; "
                "choose a rate of which that is a whole multiple"
            )
        return round(times)


_PARTS = {"disturbance": Disturbance, "shape": Shape, "sensors": Sensors, "conventions": Conventions}
# Every number's range.
_RANGES = {
    "control_rate": (0.0, 1e4), "share": (0.0, 10.0), "correlation": (0.0, 1e3), "exponent": (1.0, 4.0),
    "thrust": (0.0, 0.9), "separation": (0.0, 1.0), "outliers": (0.0, 0.5), "outlier_size": (0.0, 1e4),
    "dropouts": (0.0, 0.9), "velocity_rate": (0.0, 1e4), "tilt": (0.0, 1.5), "jitter": (0.0, 10.0),
    "added_coriolis": (0.0, 1.0), "relative": (0.0, 1.0),
}  # fmt: skip


def world_names() -> list[str]:
    """Return the shipped worlds."""
    return sorted(path.stem for path in (config_dir() / "world").glob("*.yaml"))


def make_world(given: str | Mapping[str, Any] | World | None) -> World:
    """Return the world that a name, or a mapping of options, asks for; None is the usual one.

    A mapping whose `name` is that of a shipped world starts from its numbers.

    Raises:
        ConfigError: unknown name or option, or a number out of range.
    """
    if isinstance(given, World):
        return given
    if given is None:
        return World("usual")
    options: dict[str, Any] = {"name": given} if isinstance(given, str) else dict(given)
    name = str(options.get("name", "custom"))
    if name in world_names():
        shipped = read_yaml(config_dir() / "world" / f"{name}.yaml")
        for key in _PARTS:
            options[key] = {**(shipped.get(key) or {}), **(options.get(key) or {})}
        options = {**shipped, **options}
    elif isinstance(given, str):
        raise ConfigError(unknown_name("world", given, world_names()))
    _known("option of a world", options, World)
    parts = {}
    for key, kind in _PARTS.items():
        asked = dict(options.get(key) or {})
        _known(f"option of world.{key}", asked, kind)
        parts[key] = kind(
            **{k: _number(f"world.{key}.{k}", k, v, getattr(kind(), k)) for k, v in asked.items()}
        )
    rate = _number("world.control_rate", "control_rate", options.get("control_rate", 0.0), 0.0)
    return World(name, rate, **parts, true_names=tuple(str(n) for n in options.get("true_names") or ()))


def _known(kind: str, options: Mapping[str, Any], of: type) -> None:
    names = [f.name for f in fields(of)]
    for key in options:
        if key not in names:
            raise ConfigError(unknown_name(kind, str(key), names))


def _number(where: str, key: str, value: Any, default: Any) -> Any:
    low, high = _RANGES[key]
    wanted = 2 if isinstance(default, tuple) else 1
    numbers = list(value) if isinstance(value, (list, tuple)) else [value]
    good = [
        isinstance(x, (int, float)) and not isinstance(x, bool) and np.isfinite(x) and low <= x <= high
        for x in numbers
    ]
    if len(numbers) != wanted or not all(good) or numbers != sorted(numbers):
        words = "a number" if wanted == 1 else "two rising numbers"
        raise ConfigError(f"{where} = {value!r}: {words} from {low:g} to {high:g} needed")
    return float(numbers[0]) if wanted == 1 else (float(numbers[0]), float(numbers[1]))
