"""What a fit leaves of the acceleration, for effects whose shape a cheap look at it can find."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.effects import effect_class
from auvnn.effects.hooks import Unexplained
from auvnn.estimation.window_normal_equations import linearise
from auvnn.metrics.windows import ATTITUDE, POSITION, VELOCITY, Windows
from auvnn.physics.attitude import quat_to_matrix

Array = NDArray[np.float64]
# Least time over which a difference of velocities is taken, s: noise is much of it over a shorter one; and least number.
OVER, LEAST = 0.25, 8


def is_somewhere(name: str) -> bool:
    """Whether an effect depends on where the vehicle is, so that its shape shows in what is left along the way."""
    return bool(name) and {"x", "y"} <= {*effect_class(name).channels}


def unexplained(windows: Windows, found: FittedHypothesis) -> Unexplained | None:
    """Return what a fit leaves of the acceleration; None where position or attitude was not measured.

    What free running errs by in velocity grows within a window by the force that the model lacks, as far as what the
    vehicle does about it does not count.

    Args:
        windows: of the log.
        found: the fit.
    """
    if not windows.has_position:
        return None
    # Beside a stochastic force, too, it is what free running leaves: that force would take up what is looked for.
    free, fitted = replace(windows, law=None, noise=None, around=None), found.fitted
    with torch.no_grad():
        error = torch.cat([r.error for r in linearise(fitted.model, free, fitted.initial, ())])
    times = windows.times[:, windows.warmup :].numpy()
    velocity = error[..., VELOCITY][..., :3].numpy()
    turned = (windows.mask[..., ATTITUDE] > 0).all(-1).numpy()
    known = (windows.mask[..., VELOCITY][..., :3] > 0).all(-1).numpy() & np.isfinite(velocity).all(-1)
    placed = (windows.mask[..., POSITION] > 0).all(-1).numpy()
    rotation = quat_to_matrix(windows.eta[..., 3:7]).numpy()
    parts = []
    for k in range(len(windows)):
        if placed[k].sum() < 2:
            continue
        # Positions are slower than velocities in many logs; an attitude that is missing turns nothing.
        where = np.stack(
            [np.interp(times[k], times[k][placed[k]], x[placed[k]]) for x in windows.eta[k, :, :3].numpy().T],
            axis=-1,
        )
        parts.append(_between(times[k], velocity[k], where, rotation[k], known[k] & turned[k]))
    if not parts:
        return None
    time, position, acceleration = (np.concatenate(x) for x in zip(*parts, strict=True))
    return Unexplained(time, position, acceleration) if len(time) >= LEAST else None


def _between(
    time: Array, velocity: Array, position: Array, rotation: Array, known: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return middle, position there and acceleration in NED axes, of differences between samples of one window.

    Args:
        time: of its samples, s, (L,).
        velocity: what is left of it, m/s, (L, 3).
        position: measured, m, (L, 3).
        rotation: body to NED, (L, 3, 3).
        known: samples whose velocity was measured, (L,).
    """
    taken: list[int] = []
    for k in np.flatnonzero(known):
        if not taken or time[k] - time[taken[-1]] > OVER - 1e-6:
            taken.append(int(k))
    first, last = np.array(taken[:-1], dtype=int), np.array(taken[1:], dtype=int)
    slope = (velocity[last] - velocity[first]) / (time[last] - time[first])[:, None]
    middle = (first + last) // 2
    turned = np.einsum("nij,nj->ni", rotation[middle], slope)
    return 0.5 * (time[first] + time[last]), position[middle], turned
