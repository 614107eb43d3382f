"""Compare what leaves with the model, at random states, before anybody relies on it."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from auvnn.exports.graph import evaluate
from auvnn.exports.system import System
from auvnn.models.linear.linearise import linearise

COUNT = 200

#: What sums may lose by rounding in double precision, as a share of the largest element. An element that is the
#: difference of such terms, and nought but for their rounding, differs from one processor to the next.
ROUNDED = 64 * float(np.finfo(float).eps)


def relative(mine: Any, theirs: Any) -> float:
    """Return the largest difference between two arrays (N, k), relative to the largest element of its column.

    Differences within the rounding of the largest element of all count as none.
    """
    mine, theirs = (np.asarray(x, dtype=float) for x in (mine, theirs))
    if not mine.size:
        return 0.0
    size = np.abs(theirs).max(axis=0)
    beyond = np.maximum(np.abs(mine - theirs) - ROUNDED * size.max(), 0.0).max(axis=0)
    # A column of nothing but rounding has no size.
    return float((beyond / np.maximum(size, max(1e-9 * size.max(), 1e-300))).max())


def agreement(system: System) -> dict[str, float]:
    """Return how far the graphs of a system are from its model: derivative, step of the actuators, and Jacobian."""
    a = {n: v for n, v in system.samples(COUNT, seed=7).items()}
    with torch.no_grad():
        rate = system.flow.rate(a["x"], a["u"], a["t"])
        held = [system._advanced(x[13:], u, h) for x, u, h in zip(a["s"], a["u"], a["h"], strict=True)]
        found = {
            "rate": relative(evaluate(system.rate, a), rate),
            "actuators": relative(
                evaluate(system.actuator_step, {**a, "a": a["s"][:, 13:]}), torch.stack(held)
            ),
        }
    n = system.flow.actuators.size
    inputs = system.flow.split(a["u"])
    given: dict[str, Any] = {"fins": inputs.fins, "voltage": inputs.voltage, "altitude": inputs.altitude}
    slopes = linearise(system.model, a["x"], a["u"][:, :n], time=a["t"], **given)
    mine = evaluate(system.jacobian, a)
    split = system.flow.size**2
    theirs = torch.cat([slopes.A.flatten(1), slopes.B.flatten(1)], dim=-1)
    # Commands may lie on a kink, where both slopes are right: of the inputs the middle of the errors counts.
    found["jacobian"] = relative(mine[:, :split], theirs[:, :split])
    errors = np.abs(mine[:, split:] - theirs[:, split:].numpy()).max(axis=-1)
    found["input_jacobian"] = float(np.median(errors) / max(float(theirs[:, split:].abs().max()), 1e-300))
    return found
