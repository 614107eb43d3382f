"""Drag that a simulator has no form for, as the nearest sum of linear, absolute-quadratic and quadratic terms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np
import torch
from torch import Tensor

from auvnn.effects import Effect
from auvnn.models import GreyBox, Inputs
from auvnn.models.actuation.actuators import Actuators

SPEEDS = torch.tensor([1.5, 0.75, 0.75, 0.75, 0.75, 0.75], dtype=torch.float64)
"""Velocities up to which the terms are fitted where the damping states no region, m/s and rad/s."""
KNOWN = (
    "thrust",
    "Coriolis",
    "water acceleration",
    "linear damping",
    "quadratic damping",
    "restoring",
    "fins",
)
COUNT = 3000
PAIRS = tuple(combinations_with_replacement(range(6), 2))
SMALL = 1e-9


@dataclass(frozen=True)
class Terms:
    """Coefficients of a force: + a_ij nu_j + b_ijk nu_j |nu_k| + c_ijk nu_j nu_k.

    Attributes:
        linear: a, (6, 6).
        absolute: b, (6, 6, 6).
        plain: c, (6, 6, 6), of j <= k.
        error: share of the drag's root mean square that is not in them, the largest of the degrees of freedom.
        effects: names of the effects in them.
    """

    linear: np.ndarray
    absolute: np.ndarray
    plain: np.ndarray
    error: float
    effects: tuple[str, ...]


def velocity_effects(model: GreyBox) -> list[Effect]:
    """Return the effects whose force depends on the velocity through the water alone, and vanishes without it."""
    found = []
    for effect in model.using("wrench"):
        if set(effect.hooks()) != {"wrench"}:
            continue
        alone = model.rebuilt([effect])
        nu = _velocities(model, 8, seed=1)
        a, b = _wrench(alone, nu, str(effect.name), 0), _wrench(alone, nu, str(effect.name), 1)
        rest = _wrench(alone, 0 * nu, str(effect.name), 0)
        if torch.allclose(a, b, rtol=1e-9, atol=1e-9) and float(rest.abs().max()) < 1e-12:
            found.append(effect)
    return found


def fitted(model: GreyBox) -> Terms:
    """Return the terms nearest to all drag beyond the matrices of the vehicle's file, by least squares."""
    effects = velocity_effects(model)
    still = model.rebuilt(effects)
    nu = _velocities(model, COUNT, seed=2)
    force = sum(
        (w for name, w in _wrenches(still, nu, 0).items() if name not in KNOWN), torch.zeros_like(nu)
    ).numpy()
    v = nu.numpy()
    columns = [v, (v[:, :, None] * np.abs(v[:, None, :])).reshape(len(v), 36)]
    columns.append(np.stack([v[:, j] * v[:, k] for j, k in PAIRS], axis=-1))
    basis = np.concatenate(columns, axis=1)
    scale = np.sqrt((basis**2).mean(0))
    found = np.linalg.lstsq(basis / scale, force, rcond=1e-12)[0] / scale[:, None]
    left = force - basis @ found
    size = np.sqrt((force**2).mean(0))
    share = np.sqrt((left**2).mean(0)) / np.maximum(size, 1e-6 * max(float(size.max()), 1e-12))
    # Terms far below what the fit leaves are nothing but its rounding.
    floor = np.maximum(SMALL * max(float(size.max()), 1e-12), 0.02 * np.sqrt((left**2).mean(0)))
    found[np.abs(found) * scale[:, None] < floor] = 0.0
    plain = np.zeros((6, 6, 6))
    for row, (j, k) in zip(found[42:], PAIRS, strict=True):
        plain[:, j, k] = row
    error = float(share[size > 1e-9].max()) if (size > 1e-9).any() else 0.0
    return Terms(
        found[:6].T, found[6:42].T.reshape(6, 6, 6), plain, error, tuple(str(e.name) for e in effects)
    )


def _velocities(model: GreyBox, count: int, seed: int) -> Tensor:
    region = None if model.damping is None else model.damping.region
    draw = torch.rand(count, 6, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    if region is None:
        return (2.0 * draw - 1.0) * SPEEDS
    low, high = (torch.tensor(x, dtype=torch.float64) for x in (region.low, region.high))
    return low + draw * (high - low)


def _wrenches(model: GreyBox, nu: Tensor, other: int) -> dict[str, Tensor]:
    """Return the wrenches at velocities (N, 6), in one of two places, attitudes, times and commands."""
    from auvnn.physics.attitude import euler_to_quat, quat_to_matrix

    turn = torch.tensor([0.0, 0.0, 0.0] if other == 0 else [0.3, -0.2, 1.1], dtype=torch.float64)
    rotation = quat_to_matrix(euler_to_quat(turn.expand(len(nu), 3)))
    place = torch.tensor([1.0, 2.0, 8.0], dtype=torch.float64) * (1 + 3 * other)
    actuators: Actuators = model.actuators
    command = torch.full((len(nu), actuators.size), 0.0 if other == 0 else 0.4, dtype=torch.float64)
    inputs = Inputs(
        command, None, torch.full((len(nu),), 15.0 - other), torch.full((len(nu),), 4.0 + 3 * other)
    )
    inputs = replace(inputs, voltage=inputs.voltage.double(), altitude=inputs.altitude.double())  # type: ignore[union-attr]
    time = torch.full((len(nu),), 3.0 + 40.0 * other, dtype=torch.float64)
    with torch.no_grad():
        return model.wrenches(place.expand(len(nu), 3), rotation, nu, actuators.static(command), inputs, time)


def _wrench(model: GreyBox, nu: Tensor, name: str, other: int) -> Tensor:
    return _wrenches(model, nu, other)[name]
