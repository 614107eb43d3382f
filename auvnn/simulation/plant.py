"""The plant: the model with the hidden effects in it, its drawn coefficients, and its motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.effects import EFFECTS, Parameter
from auvnn.effects.inertia_factors import InertiaFactors
from auvnn.effects.registering import values_of
from auvnn.models import GreyBox
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]

GROUPS = ("added_mass", "linear_damping", "quadratic_damping", "inertia")
# Drawn factors are kept within these: a coefficient that nearly vanishes is not a wrong number any more.
LOWEST, HIGHEST = 0.2, 5.0
TRIES = 200


def as_hidden(given: Any) -> dict[str, dict[str, float] | None]:
    """Return hidden effects by name, from a mapping, a list of names, one name or None.

    No parameters at all stand for typical ones (None); of several, those not given stay at their nulls.
    """
    given = values_of(given)
    if not given:
        return {}
    if isinstance(given, str):
        return {given: None}
    if isinstance(given, Mapping):
        return {str(n): (dict(v) if v else None) for n, v in given.items()}
    return dict.fromkeys(str(n) for n in given)


def typical_values(parameters: Sequence[Parameter], generator: np.random.Generator) -> dict[str, float]:
    """Return plausible values of an effect: each parameter half to one scale from its null, of random sign.

    Where only one side is within bounds it is taken; a positive factor about one is drawn as a ratio.
    """
    values = {}
    for p in parameters:
        size, sign = generator.uniform(0.5, 1.0), generator.choice([-1.0, 1.0])
        if p.null == 1.0 and 0.0 <= p.low < 1.0:
            value = (1.0 + p.scale) ** (sign * size)
        else:
            value = p.null + sign * size * p.scale
            if not p.low <= value <= p.high:
                value = p.null - sign * size * p.scale
        values[p.name] = float(np.clip(value, p.low, p.high))
    return values


def drawn_factors(
    vehicle: Vehicle, leave: Sequence[str], generators: Mapping[str, np.random.Generator]
) -> dict[str, dict[str, float]]:
    """Return a factor for each uncertain coefficient: 1 + N(0, stated uncertainty), kept physical.

    Args:
        vehicle: with its stated uncertainties.
        leave: groups that stay exact.
        generators: one per group, so that a group's draw does not hang on the others.
    """
    factors = {}
    for group in GROUPS:
        if group in leave or not _has(vehicle, group):
            continue
        axes = "KMN" if group == "inertia" else "XYZKMN"
        std = float(vehicle.uncertainty.get(group, 0.0))
        if std == 0.0:
            continue
        for _ in range(TRIES):
            drawn = np.clip(1.0 + std * generators[group].standard_normal(len(axes)), LOWEST, HIGHEST)
            if group != "inertia" or _is_body(vehicle.inertia, drawn):
                factors[group] = {a: float(f) for a, f in zip(axes, drawn, strict=True)}
                break
    return factors


def _has(vehicle: Vehicle, group: str) -> bool:
    if group in ("added_mass", "inertia"):
        return True
    part = group.partition("_")[0]
    matrix = getattr(vehicle, group)
    return bool(matrix is not None and np.any(matrix)) or any(
        np.any(getattr(e, part)) for e in vehicle.damping_elements
    )


def _is_body(inertia: Array, factors: Array) -> bool:
    """Say whether the scaled inertia is one that a body can have: no axis exceeds the sum of the others."""
    root = np.sqrt(factors)
    moments = np.linalg.eigvalsh(inertia * root[:, None] * root)
    return bool(moments[2] <= moments[0] + moments[1])


def make_plant(
    model: GreyBox, hidden: Mapping[str, Mapping[str, float]], factors: Mapping[str, Mapping[str, float]]
) -> GreyBox:
    """Return the model with the hidden effects and with its coefficients multiplied by the drawn factors."""
    effects = model.copied_effects()
    present = {str(e.name): i for i, e in enumerate(effects)}
    for group, values in factors.items():
        member = InertiaFactors if group == "inertia" else EFFECTS.get(group)
        if group in present:
            old = effects[present[group]].values()
            values = {a: old[a] * f for a, f in values.items()}
            effects[present[group]] = member.build(model.vehicle, model.actuation, values)
        else:
            effects.append(member.build(model.vehicle, model.actuation, values))
    return model.rebuilt(effects).with_effects(dict(hidden))
