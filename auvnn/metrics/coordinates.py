"""Coordinates in the place of velocities that have no sensor: what a free run is then judged by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Sensed
from auvnn.logs import Log, Run
from auvnn.logs.channels import EULER, POSITION, VELOCITY
from auvnn.logs.signals.noise import noise_std
from auvnn.metrics.noise import attitude_noise
from auvnn.metrics.windows import Windows
from auvnn.physics.attitude import quat_conjugate, quat_multiply, quat_to_rotvec

Array = NDArray[np.float64]
# Changes of a coordinate are measured by what they are over this long, s.
LATER = 5.0
_STANDS_FOR = dict(zip(VELOCITY, (*POSITION, *EULER), strict=True))


@dataclass(frozen=True)
class Coordinates:
    """Errors of coordinates in B windows of L samples.

    Attributes:
        places: (k,) which velocities they stand for.
        gap: measured minus predicted, (B, L, k), m and rad; attitudes as small turns about the body axes.
        stay: measured minus its value at the start, (B, L, k).
        mask: (B, L, k), 1 where it was measured.
    """

    places: list[int]
    gap: Array
    stay: Array
    mask: Array


def names_of(log: Log) -> tuple[str, ...]:
    """Return what each of the six velocities is judged by: itself, or a measured coordinate where it has no sensor."""
    absent = [n for n in VELOCITY if n in log.estimated]
    told = {*POSITION, *EULER} - set(log.estimated) - {n for run in log.runs for n in run.given}
    there = {n for n in told if n in EULER or any(n in run.channels for run in log.runs)}
    return tuple(_STANDS_FOR[n] if n in absent and _STANDS_FOR[n] in there else n for n in VELOCITY)


def spread(log: Log, names: Sequence[str]) -> tuple[Array, Array]:
    """Return standard deviation of the change over 5 s and white noise of coordinates, (6,) each; NaN for velocities."""
    std, noise = np.full(6, np.nan), np.full(6, np.nan)
    for k, name in enumerate(names):
        if name in VELOCITY:
            continue
        moves = np.concatenate([_changes(run, name) for run in log.runs])
        moves = moves[np.isfinite(moves)]
        std[k] = float(np.sqrt(np.mean(moves**2))) if len(moves) else np.nan
        own = [_noise(run, name) for run in log.runs]
        noise[k] = float(np.nanmean(own)) if np.isfinite(own).any() else np.nan
    return std, noise


def coordinates(windows: Windows, seen: Sensed, names: Sequence[str]) -> Coordinates | None:
    """Return the errors of the coordinates among some names; None where all are velocities.

    Args:
        windows: what was run.
        seen: what the sensors would report, (B, L, ...).
        names: of the six channels by which free running is judged.
    """
    places = [k for k, name in enumerate(names) if name not in VELOCITY]
    if not places:
        return None
    measured, at = windows.eta, seen.quaternion
    turn = quat_to_rotvec(quat_multiply(quat_conjugate(at), measured[..., 3:]))
    start = measured[:, :1, 3:].expand_as(measured[..., 3:])
    turned = quat_to_rotvec(quat_multiply(quat_conjugate(start), measured[..., 3:]))
    gap = torch.cat([measured[..., :3] - seen.position, turn], dim=-1).numpy()
    stay = torch.cat([measured[..., :3] - measured[:, :1, :3], turned], dim=-1).numpy()
    mask = windows.mask[..., :6].numpy()
    return Coordinates(places, gap[..., places], stay[..., places], mask[..., places])


def _values(run: Run, name: str) -> Array:
    if name in POSITION:
        assert run.position is not None
        return run.position[:, POSITION.index(name)]
    angle = run.euler[:, EULER.index(name)].copy()
    good = np.isfinite(angle)
    angle[good] = np.unwrap(angle[good])
    return angle


def _changes(run: Run, name: str) -> Array:
    values = _values(run, name)
    good = np.isfinite(values)
    if good.sum() < 2:
        return np.zeros(0)
    later = run.t + min(LATER, 0.5 * run.duration)
    inside = later <= run.t[-1]
    return np.interp(later[inside], run.t[good], values[good]) - values[inside]


def _noise(run: Run, name: str) -> float:
    if name in EULER:
        return float(attitude_noise(run)[EULER.index(name)])
    return float(np.asarray(noise_std(run.t, _values(run, name))))
