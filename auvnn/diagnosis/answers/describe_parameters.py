"""Fitted parameters as answers hold them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import Parameters
from auvnn.effects import Effect

Array = NDArray[np.float64]


def describe_parameters(effect: Effect, values: Array, std: Array) -> Parameters:
    """Return an effect's parameters with standard errors and units, by the values that people would state.

    Args:
        effect: says what its parameters are.
        values: (p,).
        std: (p,), NaN where there is none.
    """
    described = effect.parameters_of
    stated = effect.told({p.name: float(v) for p, v in zip(described, values, strict=True)})
    return {
        p.name: {"value": stated[p.name], "std": float(s), "unit": p.unit}
        for p, s in zip(described, std, strict=True)
    }
