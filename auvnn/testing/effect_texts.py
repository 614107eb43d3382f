"""What an effect says about itself, and which values it refuses."""

from __future__ import annotations

import math
from typing import Any

from auvnn.effects import Effect, Extent
from auvnn.effects.base import HOOKS
from auvnn.errors import ConfigError
from auvnn.testing.scene import (
    EXAMPLE,
    require,
    typical_values,
)
from auvnn.testing.units import powers
from auvnn.vehicle import Vehicle

Kind = type[Effect]


# An effect that wants to look around a start more often than this does not end.
MOST_LEVELS = 20


def describes_itself(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that cause, symbol, reference, units, scales and bounds are stated and make sense.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    name = getattr(kind, "name", "")
    require(
        bool(name) and name.isidentifier() and name == name.lower(),
        f"name {name!r} is no lower-case identifier",
    )
    for what in ("cause", "symbol", "reference"):
        text = getattr(kind, what, "")
        require(bool(text.strip()) and "\n" not in text, f"{name}: {what} is not stated in one line")
    for what in ("channels", "excludes"):
        value = getattr(kind, what)
        require(
            isinstance(value, tuple) and all(isinstance(v, str) for v in value), f"{name}: {what} is no tuple"
        )
    require(bool(kind.hooks()), f"{name} overrides none of the hooks {', '.join(HOOKS)}")
    described = kind.describe(vehicle, actuation)
    require(bool(described), f"{name} has no parameters")
    names = [p.name for p in described]
    require(
        len(set(names)) == len(names) and all(n.isidentifier() for n in names), f"{name}: parameters {names}"
    )
    for p in described:
        powers(p.unit)
        where = f"{name}.{p.name}"
        require(math.isfinite(p.scale) and p.scale > 0, f"{where}: scale {p.scale} is not positive")
        require(p.low <= p.null <= p.high and p.low < p.high, f"{where}: not {p.low} <= {p.null} <= {p.high}")
        require(all(p.low <= x <= p.high for x in p.probes), f"{where}: a probe is out of bounds")
    require(not all(p.shape for p in described), f"{name}: every parameter is a shape, none says how much")
    shapes = {p.name for p in described if p.shape}
    for start in kind.starts(described, Extent(0.0, 60.0, 60.0, (3.0, 8.0))):
        require(set(start) <= shapes, f"{name}: starts name {sorted(start)}, shapes are {sorted(shapes)}")
    require(set(kind.levers) <= shapes, f"{name}: levers are {kind.levers}, shapes are {sorted(shapes)}")
    amounts = {p.name for p in described if not p.shape}
    lost = [p.name for p in described if p.of and not (p.shape and p.of in amounts)]
    require(not lost, f"{name}: {lost} must be shapes that belong to one of the amounts {sorted(amounts)}")
    require(
        set(kind.carried) <= amounts and bool(kind.carried) == bool(kind.levers),
        f"{name}: {kind.carried} act on the levers {kind.levers}, amounts are {sorted(amounts)}",
    )
    _looks_around(kind, described)
    built = kind.build(vehicle, actuation)
    require(built.values() == {p.name: p.null for p in described}, f"{name} does not start at its null")
    values = typical_values(kind, vehicle, actuation)
    require(kind.build(vehicle, actuation, values).values() == values, f"{name} does not keep its values")


def _looks_around(kind: Kind, described: tuple[Any, ...]) -> None:
    """Check that the looks around a start are at shapes within bounds, wherever it is in a log, and come to an end."""
    extent = Extent(0.0, 600.0, 600.0, (3.0, 8.0))
    bounds = {p.name: (p.low, p.high) for p in described if p.shape}
    starts = kind.starts(described, extent)
    for start in (starts[0], starts[-1]):
        shape, level = {p.name: p.null for p in described if p.shape} | start, 0
        while around := kind.closest(described, extent, shape, level):
            for values in around:
                out = [
                    n for n, v in values.items() if n not in bounds or not bounds[n][0] <= v <= bounds[n][1]
                ]
                require(not out, f"{kind.name}: closest looks where {out} is no shape within its bounds")
            shape, level = around[0], level + 1
            require(level < MOST_LEVELS, f"{kind.name}: closest does not end")


def refuses(kind: Kind, vehicle: Vehicle = EXAMPLE, actuation: str = "thrusters") -> None:
    """Check that unknown parameters and values that are out of bounds or no numbers are refused.

    Args:
        kind: class of the effect.
        vehicle: in which it is tried.
        actuation: "thrusters" or "wrench".
    """
    for p in kind.describe(vehicle, actuation):
        beyond = 1e-3 * (p.high - p.low)
        wrong: list[Any] = [p.low - beyond, p.high + beyond, math.nan, math.inf, "1", True]
        for value in wrong:
            try:
                kind.build(vehicle, actuation, {p.name: value})
            except ConfigError as error:
                require(p.name in str(error) and "\n" not in str(error), f"{kind.name}: unclear: {error}")
            else:
                raise AssertionError(f"{kind.name}.{p.name} = {value!r} was accepted")
    try:
        kind.build(vehicle, actuation, {"no_such_parameter": 1.0})
    except ConfigError as error:
        require("no_such_parameter" in str(error), f"{kind.name}: unclear: {error}")
    else:
        raise AssertionError(f"{kind.name} accepted an unknown parameter")
