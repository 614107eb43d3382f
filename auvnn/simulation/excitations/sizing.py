"""How large an open-loop signal may be: as large as the vehicle bears, found on the model that the user has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from auvnn.models import GreyBox, Inputs
from auvnn.plants.own import over_ground
from auvnn.simulation.excitations.base import Array, Plan
from auvnn.simulation.limits import Limits

# Trial runs on the nominal model choose the size: of everything, and of roll and pitch (or fins) beside it.
EFFORTS = (0.1, 0.13, 0.18, 0.24, 0.32, 0.42, 0.56, 0.75, 1.0)
TILTS = (0.02, 0.06, 0.12, 0.25, 0.5, 1.0)
TRIAL_STEP, TRIAL_TIME = 0.1, 80.0

# Signals with peak one of the six degrees of freedom and the fins, (R, T, 6 + m), at times (T,), s.
Signals = Callable[[Array], Array]


def driven(
    model: GreyBox,
    limits: Limits,
    t: Array,
    starts: tuple[Array, Array],
    signals: Signals,
    effort: float,
    tilt: float,
) -> Plan:
    """Return the open-loop plan that follows signals at the largest size that keeps within bounds.

    The size is the one, of a grid tried on the model given, that excites all degrees of freedom most while roll
    and pitch stay within `tilt`, the vehicle stays under water and no thruster leaves its limits.

    Args:
        model: what the user has.
        limits: of its vehicle.
        t: times (T,), s.
        starts: eta (R, 7) and nu (R, 6).
        signals: peak one in each degree of freedom.
        effort: largest share of a thruster's limit.
        tilt: largest roll and pitch aimed at, rad.
    """
    eta0, nu0 = starts
    efforts, tilts = _sizes(model, limits, t, eta0, nu0, signals, effort, tilt)
    command, fins = limits.drive(signals(t), efforts[:, None, None], tilts[:, None, None])
    return Plan(eta0, nu0, command, fins, under_way=limits.steady is not None)


def _sizes(
    model: GreyBox,
    limits: Limits,
    t: Array,
    eta0: Array,
    nu0: Array,
    signals: Signals,
    effort: float,
    most: float,
) -> tuple[Array, Array]:
    """Return effort and tilt by run, each the best of the grid."""
    times = np.arange(0.0, min(TRIAL_TIME, float(t[-1])) + 1e-9, TRIAL_STEP)
    unit = signals(times)
    # Slow, the fins would have no hold on the water.
    efforts = EFFORTS if limits.steady is None else EFFORTS[-1:]
    pairs = np.array([(e, a) for e in efforts for a in TILTS])
    efforts, tilts = effort * pairs[:, 0, None, None, None], pairs[:, 1, None, None, None]
    command, fins = limits.drive(unit[None], efforts, tilts)
    shape = (len(pairs), len(unit))
    inputs = Inputs(_tensor(command), None if fins is None else _tensor(fins), limits.voltage(shape, times))
    eta, nu = _tensor(np.broadcast_to(eta0, (*shape, 7))), _tensor(np.broadcast_to(nu0, (*shape, 6)))
    if limits.steady is not None:
        nu = over_ground(model, eta, nu)
    run = model.rollout(eta, nu, inputs, _tensor(times), max_step=TRIAL_STEP, check=False, engine="firm")
    score = _score(run.eta.numpy(), run.nu.numpy(), most)
    best = score.argmax(axis=0)
    return pairs[best, 0] * effort, pairs[best, 1]


def _score(eta: Array, nu: Array, tilt: float) -> Array:
    """Return how well each trial (S, R) excites; those out of bounds count by how far they are out."""
    w, x, y, z = np.moveaxis(eta[..., 3:], -1, 0)
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
        leaning = np.maximum(np.abs(roll), np.abs(pitch)).max(axis=-1) / tilt
        depth = eta[..., 0, 2]
        rising = (depth - eta[..., 2].min(axis=-1)) / np.maximum(depth - 1.0, 0.5)
        over = np.maximum(np.maximum(leaning, rising) - 1.0, 0.0)
        score = np.log(nu.std(axis=-2) + 1e-3).sum(axis=-1)
    score = np.where(over > 0, -1e3 - over, score)
    return np.where(np.isfinite(nu).all(axis=(-1, -2)) & np.isfinite(over), score, -np.inf)


def _tensor(array: Array) -> torch.Tensor:
    return torch.tensor(np.ascontiguousarray(array))
