"""Fitted parameters as answers tell them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.effects import Effect

Array = NDArray[np.float64]


def describe_parameters(effect: Effect, values: Array, std: Array) -> dict[str, dict[str, Any]]:
    """Return an effect's parameters with standard errors and units, by the values that people would state.

    Args:
        effect: says what its parameters are.
        values: (p,).
        std: (p,), NaN where there is none.
    """
    described = effect.parameters_of
    stated = effect.told({p.name: float(v) for p, v in zip(described, values, strict=True)})
    return {
        p.name: {"value": stated[p.name], "std": s, "unit": p.unit}
        for p, s in zip(described, std, strict=True)
    }
