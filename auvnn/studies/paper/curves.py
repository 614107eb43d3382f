"""The damping learned against the plant's own, each velocity alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

from auvnn.logs import Log
from auvnn.models import GreyBox, Inputs
from auvnn.models.equations_of_motion import DRAG_TERMS


def drag(model: GreyBox, nu: torch.Tensor) -> torch.Tensor:
    """Return what resists motion in a model (N, 6), N and N m, on the left-hand side."""
    zero = torch.zeros(len(nu), 3, dtype=nu.dtype)
    upright = torch.eye(3, dtype=nu.dtype).expand(len(nu), 3, 3)
    thrust = torch.zeros(len(nu), model.actuators.size, dtype=nu.dtype)
    with torch.no_grad():
        terms = model.wrenches(zero, upright, nu, thrust, Inputs(thrust), torch.zeros((), dtype=nu.dtype))
    found = [-terms[name] for name in DRAG_TERMS if name in terms]
    return torch.stack(found).sum(0) if found else torch.zeros_like(nu)


def damping_curves_of(model: GreyBox, plant: GreyBox, log: Log, points: int = 121) -> list[dict[str, Any]]:
    """Return for each degree of freedom the learned and the true damping over the velocities of a log and beyond."""
    out = []
    nu = np.concatenate([run.nu for run in log.runs])
    for k in range(6):
        low, high = float(np.nanmin(nu[:, k])), float(np.nanmax(nu[:, k]))
        grid = np.linspace(-1.5, 1.5, points) * max(abs(low), abs(high), 1e-6)
        states = torch.zeros(points, 6, dtype=torch.float64)
        states[:, k] = torch.tensor(grid)
        learned, truth = (drag(m, states).numpy()[:, k] for m in (model, plant))
        out.append({"nu": grid, "learned": learned, "nominal": truth, "covered": (low, high)})
    return out
