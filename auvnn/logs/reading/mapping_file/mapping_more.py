"""What a mapping says about recordings with topics of their own times, frames and clocks.

Of a column, beside `from`, `scale`, `offset`, `curve`, `delay`, `valid` and `by`:

- `unit: deg` the unit of the file by its name, turned into SI before anything else;
- `mix: [{from: RCIN.C5, weight: 0.7}, {from: RCIN.C6, weight: -0.7}]` a weighed sum of inputs,
  each after the `curve`, in the place of `from`;
- `over: VISO.dt` (or `{from: VISO.dt, unit: us}`) divides a displacement by the time that it took;
- `difference: true` the derivative of what is there, a velocity of positions;
- `in: world` a velocity along north, east, down in the place of the body's axes, turned with the attitude;
- `pressure: {surface: 101325, density: 1025}` a depth from an absolute pressure: (p - surface) / (density 9.80665).

Of the recording: `topics: {/odom: {body: FLU, world: ENU, offset: 0.0, delay: 0.0, stamps: header, trust: false}}`,
`rows: /dvl`, `commands: {between: held, longest: 2.0}`, `heading: {offset: 3.1, unit: deg, runs: {2: 3.4}}` and
`definitions: folder`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError
from auvnn.logs.reading.mapping_file.units import _G, _known, _number, _truth, unit_factor

Array = NDArray[np.float64]

KEYS = ("unit", "mix", "over", "difference", "in", "pressure")
SECTIONS = ("topics", "rows", "commands", "heading", "definitions")
_SIGNALS = ("u", "v", "w", "p", "q", "r")


@dataclass(frozen=True)
class More:
    """The further options of one column.

    Args:
        factor: of the unit, to SI; None where none is named.
        mix: inputs and their weights in the place of one source.
        over: column that holds the time by which a displacement is divided.
        over_factor: of that time's unit, to seconds.
        difference: whether the derivative is meant.
        world: whether a velocity is along the world's axes.
        pressure: at the surface, Pa, and density of the water, kg/m3, of a depth that is measured as a pressure.
    """

    factor: float | None = None
    mix: tuple[tuple[str, float], ...] = ()
    over: str | None = None
    over_factor: float = 1.0
    difference: bool = False
    world: bool = False
    pressure: tuple[float, float] | None = None

    def in_si(self, raw: NDArray[Any]) -> NDArray[Any]:
        """Return values in SI, of a pressure the depth in m."""
        if self.factor is not None and self.factor != 1.0:
            raw = raw.astype(np.float64) * self.factor
        if self.pressure is not None:
            surface, density = self.pressure
            raw = (raw.astype(np.float64) - surface) / (density * _G)
        return raw

    def speed(self, displacement: NDArray[Any], time: NDArray[Any]) -> Array:
        """Return displacements over the times that they took, NaN where no time passed."""
        seconds = time.astype(np.float64) * self.over_factor
        return np.where(seconds > 0.0, displacement / np.where(seconds > 0.0, seconds, 1.0), np.nan)


@dataclass(frozen=True)
class TopicRule:
    """How a topic is stamped and framed.

    Args:
        body: frame of its velocities, "FRD" or "FLU"; None for the mapping's.
        world: frame of its poses, "NED" or "ENU"; None for the mapping's.
        offset: s that its clock is behind the recording's; "auto" to find it.
        delay: s by which its stamps are late.
        stamps: "header" or "arrival".
        trust: whether it is used although its kind is known to lie about its frame.
    """

    body: str | None = None
    world: str | None = None
    offset: float | str = 0.0
    delay: float = 0.0
    stamps: str = "header"
    trust: bool = False


@dataclass(frozen=True)
class Commands:
    """What holds between two commands.

    Args:
        between: "held" or "linear".
        longest: s that a command holds if no other follows; None for ten of its steps, 2 s at least.
    """

    between: str = "held"
    longest: float | None = None


@dataclass(frozen=True)
class Heading:
    """What is added to the measured heading.

    Args:
        offset: rad.
        runs: rad, by run number, in the place of `offset`.
    """

    offset: float = 0.0
    runs: dict[int, float] = field(default_factory=dict)

    def of(self, run: int) -> float:
        """Return what is added in one run, rad."""
        return self.runs.get(run, self.offset)


def of_column(value: Mapping[str, Any], name: str, here: str) -> More:
    """Return a column's further options.

    Args:
        value: the column's entry.
        name: canonical name of the column.
        here: where the entry stands, for messages.

    Raises:
        ConfigError: one of them is wrong, or contradicts another.
    """
    found: dict[str, Any] = {}
    if "unit" in value:
        found["factor"] = unit_factor(value["unit"], f"{here}: unit")
    if "mix" in value:
        if "from" in value:
            raise ConfigError(f"{here}: 'mix' stands in the place of 'from'; give one of them")
        found["mix"] = _mix(value["mix"], f"{here}: mix")
    if "over" in value:
        over = value["over"]
        over = {"from": over} if isinstance(over, str) else over
        if not isinstance(over, Mapping) or not isinstance(over.get("from"), str):
            raise ConfigError(
                f"{here}: over must name the column of the time that a displacement took, not {over!r}"
            )
        _known(over, ("from", "unit"), f"{here}: over")
        found["over"] = over["from"]
        found["over_factor"] = unit_factor(over.get("unit", "s"), f"{here}: over: unit")
    if "difference" in value:
        found["difference"] = _truth(value["difference"], f"{here}: difference")
        if name not in _SIGNALS:
            raise ConfigError(f"{here}: 'difference' makes velocities: it is for u, v, w, p, q, r")
    if "in" in value:
        if value["in"] not in ("world", "body") or name not in _SIGNALS[:3]:
            raise ConfigError(f"{here}: 'in' is world or body, of u, v and w; not {value['in']!r} of {name}")
        found["world"] = value["in"] == "world"
    if "pressure" in value:
        found["pressure"] = _pressure(value["pressure"], name, f"{here}: pressure")
    return More(**found)


def _mix(value: Any, here: str) -> tuple[tuple[str, float], ...]:
    if not isinstance(value, list) or not value:
        raise ConfigError(f"{here}: must be a list of {{from: input, weight: number}}, not {value!r}")
    found = []
    for item in value:
        if not isinstance(item, Mapping) or not isinstance(item.get("from"), str):
            raise ConfigError(f"{here}: {item!r} must say {{from: input, weight: number}}")
        _known(item, ("from", "weight"), here)
        found.append((item["from"], _number(item.get("weight", 1.0), f"{here}: weight")))
    return tuple(found)


def _pressure(value: Any, name: str, here: str) -> tuple[float, float]:
    if not isinstance(value, Mapping) or name != "z":
        raise ConfigError(f"{here}: belongs to z and is {{surface: Pa, density: kg/m3}}, not {value!r}")
    _known(value, ("surface", "density"), here)
    density = _number(value.get("density", 1025.0), f"{here}: density")
    if density <= 0.0:
        raise ConfigError(f"{here}: density: {density:g} must be above zero")
    return _number(value.get("surface", 101325.0), f"{here}: surface"), density


def sections(data: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the mapping's further sections, checked.

    Raises:
        ConfigError: a key or a value is wrong.
    """
    found: dict[str, Any] = {}
    topics = data.get("topics") or {}
    if not isinstance(topics, Mapping):
        raise ConfigError(f"{where}: topics must hold `name: {{...}}` lines, not {topics!r}")
    found["topics"] = {str(name): _topic(rule, f"{where}: topics: {name}") for name, rule in topics.items()}
    for key in ("rows", "definitions"):
        if data.get(key) is not None:
            if not isinstance(data[key], str):
                raise ConfigError(f"{where}: {key}: must be a name, not {data[key]!r}")
            found[key] = data[key]
    if data.get("commands") is not None:
        found["commands"] = _commands(data["commands"], f"{where}: commands")
    if data.get("heading") is not None:
        found["heading"] = _heading(data["heading"], f"{where}: heading")
    return found


def _topic(rule: Any, here: str) -> TopicRule:
    if not isinstance(rule, Mapping):
        raise ConfigError(f"{here}: must be {{body: ..., world: ..., offset: ...}}, not {rule!r}")
    _known(rule, ("body", "world", "offset", "delay", "stamps", "trust"), here)
    found: dict[str, Any] = {}
    for key, choices in (
        ("body", ("FRD", "FLU")),
        ("world", ("NED", "ENU")),
        ("stamps", ("header", "arrival")),
    ):
        if key in rule:
            if rule[key] not in choices:
                raise ConfigError(f"{here}: {key}: {unknown_name('choice', str(rule[key]), choices)}")
            found[key] = rule[key]
    if "offset" in rule:
        found["offset"] = "auto" if rule["offset"] == "auto" else _number(rule["offset"], f"{here}: offset")
    if "delay" in rule:
        found["delay"] = _number(rule["delay"], f"{here}: delay")
    if "trust" in rule:
        found["trust"] = _truth(rule["trust"], f"{here}: trust")
    return TopicRule(**found)


def _commands(value: Any, here: str) -> Commands:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{here}: must be {{between: held, longest: seconds}}, not {value!r}")
    _known(value, ("between", "longest"), here)
    between = value.get("between", "held")
    if between not in ("held", "linear"):
        raise ConfigError(f"{here}: between: {unknown_name('choice', str(between), ('held', 'linear'))}")
    longest = None if value.get("longest") is None else _number(value["longest"], f"{here}: longest")
    if longest is not None and longest <= 0.0:
        raise ConfigError(f"{here}: longest: {longest:g} must be above zero")
    return Commands(between, longest)


def _heading(value: Any, here: str) -> Heading:
    if not isinstance(value, Mapping):
        raise ConfigError(f"{here}: must be {{offset: ..., unit: deg}}, not {value!r}")
    _known(value, ("offset", "unit", "runs"), here)
    factor = unit_factor(value.get("unit", "rad"), f"{here}: unit")
    runs = value.get("runs") or {}
    if not isinstance(runs, Mapping):
        raise ConfigError(f"{here}: runs must be {{1: offset, 2: offset}}, not {runs!r}")
    found = {}
    for number, offset in runs.items():
        try:
            found[int(number)] = factor * _number(offset, f"{here}: runs: {number}")
        except (TypeError, ValueError) as problem:
            if isinstance(problem, ConfigError):
                raise
            raise ConfigError(f"{here}: runs: {number!r} is no run number") from None
    return Heading(factor * _number(value.get("offset", 0.0), f"{here}: offset"), found)
