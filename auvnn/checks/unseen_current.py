"""A current that the log does not know of: velocities are over ground, and what resists is the water."""

from __future__ import annotations

import numpy as np

from auvnn.checks import regression
from auvnn.errors import AuvnnError
from auvnn.logs import Log
from auvnn.models import GreyBox

_SMALL = 0.05  # m/s with which the model is asked
_SLOWEST = 0.05  # m/s: less is not worth a word
_CLEAR = 25.0  # chi-square of two parameters, correlation in time counted: about one in 300 000 by chance
_SHARE = 0.02  # of what is left of the acceleration that it must explain


def doubts(model: GreyBox, log: Log) -> list[str]:
    """Warn of a current that the model's residual shows and nothing in the model accounts for.

    The acceleration that a steady current would add is linear in it; its two coefficients are fitted to what one-step
    predictions leave, with drag, products of velocities, gravity and constants in body axes added to them, so that only
    what stays put in the world while the vehicle turns can count.

    Args:
        model: the model.
        log: measurements, velocities over ground.
    """
    if "ocean_current" in model.effect_names or model.using("water"):
        return []
    try:
        found = estimate_current(model, log)
    except (AuvnnError, np.linalg.LinAlgError):
        return []
    if found is None:
        return []
    (north, east), (north_std, east_std), chi, share = found
    if float(np.hypot(north, east)) < _SLOWEST or chi < _CLEAR or share < _SHARE:
        return []
    return [
        "velocities are over ground, and what the model as given leaves looks like a current of about "
        f"{north:.2f} m/s north and {east:.2f} m/s east (standard errors {north_std:.1g} and {east_std:.1g}): "
        "consider the effect ocean_current"
    ]


def estimate_current(
    model: GreyBox, log: Log
) -> tuple[tuple[float, float], tuple[float, float], float, float] | None:
    """Return north and east current, m/s, their standard errors, chi-square, and the share of the residual explained.

    Raises:
        AuvnnError: the model cannot be compared with the log.
    """
    here = regression.regression_rows(model, log)
    if len(here.gap) < 200:
        return None
    gap = regression.without(here.nuisance, here.gap)
    # A model that explains the log to the last digit leaves nothing that could look like a current.
    if not gap.any():
        return None
    pushed = []
    for name in ("v_north", "v_east"):
        moved = model.with_effects({"ocean_current": {name: _SMALL}})
        there = regression.regression_rows(moved, log)
        pushed.append(regression.without(here.nuisance, (here.gap - there.gap) / _SMALL))
    weight = 1.0 / np.maximum((gap**2).mean(0), 1e-300)
    columns = np.stack(pushed, axis=-1)  # (N, 6, 2)
    square = np.einsum("nik,i,nil->kl", columns, weight, columns)
    if np.linalg.cond(square) > 1e8:
        return None
    for _ in range(3):
        square = np.einsum("nik,i,nil->kl", columns, weight, columns)
        current = np.linalg.solve(square, np.einsum("nik,i,ni->k", columns, weight, gap))
        left = gap - columns @ current
        weight = 1.0 / np.maximum((left**2).mean(0), 1e-300)
    factor = regression.variance_inflation(here, left, columns.reshape(len(columns), -1))
    square = np.einsum("nik,i,nil->kl", columns, weight, columns) / factor
    std = np.sqrt(np.diag(np.linalg.inv(square)))
    chi = float(current @ square @ current)
    before, after = (float(np.einsum("ni,i,ni->", x, weight, x)) for x in (gap, left))
    share = 1.0 - after / before
    return (float(current[0]), float(current[1])), (float(std[0]), float(std[1])), chi, share
