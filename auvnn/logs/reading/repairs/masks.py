"""Samples that a sensor did not measure but say so by their value: negative heights, sentinels, full scale."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.channels import ACCELERATION, VELOCITY
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import Run

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SENTINEL_JUMP = 0.5  # m beyond what the fastest motion of the log covers in a step
_FLAT = 3  # equal samples at the extreme make a clipped top
_CLIPPED = 5  # samples at full scale before it is called so
_EDGE = 0.003  # of full scale: how steeply a clipped signal runs into its limit, most of the times
_HELD = 0.05  # share of repeated samples from which equal neighbours mean nothing


def apply(run: Run, where: str) -> tuple[Run, list[Repair]]:
    """Return the run with such samples read as missing, and their count."""
    changes: dict[str, Any] = {}
    repairs: list[Repair] = []
    if run.altitude is not None:
        wrong = run.altitude < 0.0
        if wrong.any():
            changes["altitude"] = np.where(wrong, np.nan, run.altitude)
            words = "negative heights above the bottom, which mean none was measured, read as missing"
            repairs.append(Repair(words, where, int(wrong.sum())))
    if run.position is not None:
        wrong = sentinels(run.t, run.position[:, 2], run.nu[:, :3])
        if wrong.any():
            position = run.position.copy()
            low = float(position[wrong, 2].min())
            position[wrong, 2] = np.nan
            changes["position"] = position
            words = f"depths of {low:g} m, which mean none was measured, read as missing"
            repairs.append(Repair(words, where, int(wrong.sum())))
    for block, names in (("nu", VELOCITY), ("nu_dot", ACCELERATION)):
        values = getattr(run, block)
        if values is None:
            continue
        # Velocities through the water come from other sensors than the inertial ones.
        for i in range(3 if block == "nu" else 0, 6):
            wrong, scale = clipped(values[:, i])
            if wrong.any():
                changes[block] = changes.get(block, values).copy()
                changes[block][wrong, i] = np.nan
                words = f"samples of '{names[i]}' at full scale ({scale:.4g}) read as missing"
                cure = "set the sensor to a wider range"
                repairs.append(Repair(words, where, int(wrong.sum()), "warning", cure))
    return (replace(run, **changes) if changes else run), repairs


def sentinels(t: Array, z: Array, velocity: Array) -> Mask:
    """Return the samples (N,) of a depth that is one and the same negative number and cannot have been reached.

    Args:
        t: s, (N,).
        z: depth, m, (N,); NaN is missing.
        velocity: m/s, (N, 3), which bounds how far the depth goes in a step.
    """
    none = np.zeros(len(z), dtype=bool)
    negative = z[z < 0.0]
    if len(negative) == 0:
        return none
    values, counts = np.unique(negative, return_counts=True)
    value = values[np.argmax(counts)]
    at = z == value
    others = np.isfinite(z) & ~at
    if at.sum() < 2 or not others.any() or value > np.nanmin(z[others]):
        return none
    speed = np.linalg.norm(velocity, axis=1)
    fastest = float(np.nanmax(speed)) if np.isfinite(speed).any() else 0.0
    rows = np.flatnonzero(np.isfinite(z))
    change = np.flatnonzero(at[rows][1:] != at[rows][:-1])
    if len(change) == 0:
        return none
    step = np.abs(np.diff(z[rows])[change])
    reach = fastest * np.diff(t[rows])[change] + _SENTINEL_JUMP
    return at if bool((step > reach).all()) else none


def clipped(y: Array) -> tuple[Mask, float]:
    """Return the samples (N,) at which a sensor was at the end of its range, and that end.

    The extreme must be reached by several samples in a row, run into at a slope that cannot end so suddenly, and
    this more than by chance; a signal that is sampled and held, or settles smoothly, is left alone.

    Args:
        y: signal, (N,); NaN is missing.
    """
    none = np.zeros(len(y), dtype=bool)
    good = np.isfinite(y)
    if good.sum() < 20:
        return none, np.nan
    scale = float(np.abs(y[good]).max())
    at = np.abs(y) == scale
    if scale == 0.0 or at.sum() < _CLIPPED or at.sum() > 0.5 * good.sum():
        return none, scale
    inside = good[1:] & good[:-1] & ~(at[1:] & at[:-1])
    if (y[1:] == y[:-1])[inside].mean() > _HELD:
        return none, scale
    same = np.concatenate([[False], (y[1:] == y[:-1])])
    starts = np.flatnonzero(~same)
    lengths = np.diff(np.append(starts, len(y)))
    flat = (lengths >= _FLAT) & at[starts]
    tops = [(int(s), int(s + n)) for s, n in zip(starts[flat], lengths[flat], strict=True)]
    steep = [
        max(
            abs(y[s] - y[s - 1]) if s > 0 and good[s - 1] else 0.0,
            abs(y[e] - y[e - 1]) if e < len(y) and good[e] else 0.0,
        )
        > _EDGE * scale
        for s, e in tops
    ]
    return (at, scale) if tops and np.mean(steep) > 0.5 else (none, scale)
