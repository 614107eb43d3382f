"""Hidden effects of a stated cost: by how much a model without one errs more over five seconds than one with it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.effects import Parameter
from auvnn.errors import AuvnnError, ConfigError
from auvnn.logs import Log
from auvnn.models import GreyBox

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, float]]

HORIZON = "5"
# Of the search: how often a log is made, how near is near enough (of the cost's logarithm), and the first size in
# plausible scales.
TRIALS, NEAR, FIRST = 6, 0.15, 0.3
# No size beyond so many plausible scales is tried.
MOST = 60.0


def cost_of(model: GreyBox, log: Log, hidden: Values) -> float | None:
    """Return (E without - E with) / E with, E the 5 s error of the model without and with what is hidden.

    None where the model with it cannot be run.

    Args:
        model: without what is hidden.
        log: measurements.
        hidden: effects, name to parameters.
    """
    from auvnn.metrics.rollouts import roll, scale_of

    scale = scale_of(log)
    without, whole = (roll(m, log, HORIZON, scale) for m in (model, model.with_effects(dict(hidden))))
    if without is None or whole is None:
        return None
    least, now = whole.total(scale), without.total(scale)
    return float(now / least - 1.0) if np.isfinite(now) and least > 0.0 else None


def costly(
    model: GreyBox,
    effect: str,
    cost: float,
    *,
    seed: int,
    runs: int = 4,
    duration: float = 60.0,
    max_step: float = 0.025,
    **how: Any,
) -> dict[str, float]:
    """Return parameters of an effect in a random direction whose absence costs so much of the 5 s error.

    Directions and shapes are drawn as in `hidden.sized`, in units of the parameters' plausible scales. The size is
    found by logs of two runs in the same world, all that departs from the model's assumptions included: what costs
    much in a quiet world may cost little in a restless one. Where an effect reaches its bounds before the cost, it
    stays there.

    Args:
        model: what the user knows.
        effect: name.
        cost: such as 0.4.
        seed: of direction and manoeuvre.
        runs: of the log that is to be made.
        duration: of each run, s.
        max_step: of the plant, s.
        how: excitation, noise, rate, plant, world, coefficients, as in `simulate`.

    Raises:
        ConfigError: the effect changes nothing on this vehicle under this excitation.
    """
    from auvnn.simulation import simulate
    from auvnn.simulation.simulate import bottom_below
    from auvnn.studies.hidden import drawn_direction

    conditions = {**how, "runs": min(runs, 2), "duration": duration, "seed": seed, "max_step": max_step}
    kind = {k: conditions[k] for k in ("excitation", "runs", "duration", "rate", "seed") if k in conditions}
    nominal = simulate(model, noise="realistic", max_step=max_step, **kind)
    described, direction, shape = drawn_direction(model, effect, nominal.log, seed)
    if "altitude" in type(model.with_effects({effect: {}}).effect(effect)).channels:
        # That of the log that is to be made: all runs have one bottom.
        conditions["bottom"] = bottom_below(
            model, **{"excitation": "multisine", "rate": 20.0, **kind, "runs": runs}
        )

    def at(size: float) -> dict[str, float]:
        return _moved(described, direction, shape, size)

    low, high, size = 0.0, MOST, FIRST
    best: tuple[float, float] | None = None
    for _ in range(TRIALS):
        try:
            made = simulate(model, hidden={effect: at(size)}, **conditions)
            found = cost_of(model, made.log, {effect: at(size)})
        except AuvnnError:
            found = None
        if found is None:
            # The plant does not bear it.
            high = min(high, size)
            size = 0.5 * (low + size)
            continue
        miss = abs(np.log(max(found, 1e-4) / cost))
        if best is None or miss < best[0]:
            best = (float(miss), size)
        if miss < NEAR:
            break
        low, high = (max(low, size), high) if found < cost else (low, min(high, size))
        # Errors add by their squares: (1 + cost)^2 = 1 + (k size)^2.
        gained = (1.0 + found) ** 2 - 1.0
        ratio = np.sqrt(((1.0 + cost) ** 2 - 1.0) / gained) if gained > 1e-3 else 8.0
        wanted = size * float(np.clip(ratio, 0.1, 8.0))
        size = wanted if low < wanted < high else (0.5 * (low + high) if high < MOST else min(wanted, MOST))
        if at(size) == at(low):
            break
    if best is None:
        raise ConfigError(
            f"{effect} cannot be hidden in {model.vehicle.name} at a cost of {cost:g}: it diverges"
        )
    values = at(best[1])
    if all(values[p.name] == p.null for p in described if not p.shape):
        raise ConfigError(
            f"{effect} leaves no trace on {model.vehicle.name} under this excitation: choose another"
        )
    return values


def _moved(
    described: tuple[Parameter, ...], direction: Array, shape: Mapping[str, float], size: float
) -> dict[str, float]:
    """Return the parameters so many scales along a direction; a positive factor about one moves by its logarithm."""
    out = {}
    for p, way in zip(described, direction, strict=True):
        if p.shape:
            value = shape.get(p.name, p.null)
        elif p.null == 1.0 and 0.0 <= p.low < 1.0:
            value = float((1.0 + p.scale) ** np.clip(size * way, -20.0, 20.0))
        else:
            value = p.null + size * way * p.scale
        out[p.name] = float(np.clip(value, p.low, p.high))
    return out
