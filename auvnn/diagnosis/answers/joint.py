"""What each of several names does in addition to the others, for names that predict without being the cause."""

from __future__ import annotations

from typing import Any

import numpy as np

from auvnn.diagnosis.answers.confounded import confounded_with
from auvnn.diagnosis.answers.effect_costs import Worth
from auvnn.diagnosis.answers.table import values
from auvnn.diagnosis.residuals.forces import AXES
from auvnn.diagnosis.residuals.variance_component_test import variance_component_test, white
from auvnn.diagnosis.stages.state import Setting, State


def joint(asked: Setting, state: State, found: Worth) -> dict[str, dict[str, Any]]:
    """Return of each name its joint values, the share of the force that it explains, its gain, and its look-alikes.

    The share is that of the energy of what looks like a force (`variance_component_test`) that comes back in a degree
    of freedom when the name is taken out and everything else fitted again.

    Args:
        asked: what was asked.
        state: of the search at its end.
        found: what each name is worth, with the fits without it.
    """
    last = state.current
    noise = white(last, asked.floor)
    energy = np.maximum(variance_component_test(state.first, state.windows, noise).energy, 0.0)
    left = variance_component_test(last, state.windows, noise).energy
    told = values(asked.layout, last, last.effects)
    out = {}
    for name in last.effects:
        less = variance_component_test(found.without[name], state.windows, noise).energy
        back = np.maximum(less, 0.0) - np.maximum(left, 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.where(energy > 0.01 * energy.sum(), np.clip(back / energy, 0.0, 1.0), 0.0)
        cost = found.names[name]
        out[name] = {
            "parameters": told[name],
            "explained_by_dof": {a: float(s) for a, s in zip(AXES, share, strict=True)},
            "gain": None
            if cost.gain is None
            else {"value": cost.gain.value, "std": cost.gain.std, "cost": cost.gain.cost},
            "confounded_with": confounded_with(asked.layout, last, name),
        }
    return out
