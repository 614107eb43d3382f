"""Stretches in which something other than water and thrusters moves or holds the vehicle.

At the surface, in the air, on the bottom, in somebody's hand or at the end of its tether the equations of motion are
others, and a fit would take them for the vehicle's. Each is recognised by what it does to the log; where the evidence
allows several, the words name them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.signals.noise import noise_std
from auvnn.logs.signals.rotation import rotate

if TYPE_CHECKING:
    from auvnn.logs.log import Log
    from auvnn.logs.run import Run

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_AT_SURFACE, _ABOVE = 0.1, -0.3  # m of depth
_DEEP = 0.5  # m: what most of the log must be below for the surface to be worth a word
_BOTTOM = 0.15  # m of height above the bottom
_NEUTRAL, _DRIVEN = 0.03, 0.3  # of the log's strong commands
_STILL = 0.02  # of the channel's 99th percentile
_SHORTEST = 3.0  # s
_GAIN = 0.25  # of the log's usual speed that is gained without any command
_SETTLE, _DRIFTING = 8.0, 0.05  # s without command, and m/s that are left after it
_EASE = 0.2  # share by which a drift may still change over the second half of such a stretch


@dataclass(frozen=True)
class Stretch:
    """Part of a run in one of those situations.

    Args:
        kind: "surface", "air", "bottom", "held", "moved" or "drifting".
        run: number.
        start: s.
        stop: s.
        value: of "drifting" the speed over ground, m/s, else 0.
    """

    kind: str
    run: int
    start: float
    stop: float
    value: float = 0.0


WORDS = {
    "surface": "at the surface, where added mass, buoyancy and waves are others",
    "air": "above the surface, in the air",
    "bottom": "on the bottom: driven, but standing still close above it",
    "held": "driven, but standing still: on the bottom, held by hand, or its tether is tight?",
    "moved": "set in motion without any command: by hand, by its tether, by waves?",
}


def find(log: Log) -> list[Stretch]:
    """Return all such stretches, in order of runs and time."""
    depth = np.concatenate([[], *(run.position[:, 2] for run in log.runs if run.position is not None)])
    depth = depth[np.isfinite(depth)]
    deep = len(depth) > 0 and float(np.quantile(depth, 0.75)) > _DEEP
    nu = np.concatenate([run.nu for run in log.runs])
    with np.errstate(invalid="ignore"):
        usual = np.array([np.nanquantile(np.abs(c), 0.99) if np.isfinite(c).any() else 0.0 for c in nu.T])
    strong = _strong(log)
    found = []
    for run in log.runs:
        if deep and run.position is not None:
            z = run.position[:, 2]
            found += _stretches(run, z < _ABOVE, "air", 2.0)
            found += _stretches(run, (z < _AT_SURFACE) & (z >= _ABOVE), "surface", 2.0)
        level = _level(run, strong)
        if level is not None:
            noise = np.nan_to_num(np.asarray(noise_std(run.t, run.nu)))
            found += _held(run, level, usual, noise)
            found += _moved(run, level, usual, noise)
            found += _drifting(run, level, noise)
    return found


def _strong(log: Log) -> Array | None:
    """Return what counts as a full command by channel: the 95th percentile of its size."""
    commands = [run.command for run in log.runs]
    if any(c is None for c in commands):
        return None
    size = np.abs(np.concatenate([c for c in commands if c is not None]))
    with np.errstate(invalid="ignore"):
        strong = np.array([np.nanquantile(c, 0.95) if np.isfinite(c).any() else 0.0 for c in size.T])
    return strong if strong.max() > 0.0 else None


def _level(run: Run, strong: Array | None) -> Array | None:
    """Return how strongly the vehicle is driven, (N,), 1 at the log's strong commands."""
    if strong is None or run.command is None:
        return None
    # Forces and moments, or thrusters: a channel that is never used much is measured by the others.
    scale = (
        np.maximum(strong, 0.1 * strong.max())
        if run.thrusters is not None
        else np.where(strong > 0, strong, np.inf)
    )
    return (np.abs(run.command) / scale).max(axis=1)


def _held(run: Run, level: Array, usual: Array, noise: Array) -> list[Stretch]:
    limit = np.maximum(np.maximum(5.0 * noise, _STILL * usual), 1e-6)
    still = np.asarray((np.abs(run.nu) <= limit).all(axis=1))
    out = []
    for part in _parts(run, still, _SHORTEST):
        driven = level[part]
        if np.nanmean(driven > _DRIVEN) < 0.8:
            continue
        near = run.altitude is not None and np.nanmin(np.append(run.altitude[part], np.inf)) < _BOTTOM
        out.append(_stretch(run, part, "bottom" if near else "held"))
    return out


def _moved(run: Run, level: Array, usual: Array, noise: Array) -> list[Stretch]:
    """Find motion that grows while nothing drives; straight up or down is left to weight and buoyancy."""
    speed = np.linalg.norm(rotate(run.quaternion, run.nu[:, :3])[:, :2], axis=1)
    turning = np.abs(run.nu[:, 5])
    out = []
    for part in _parts(run, level < _NEUTRAL, _SHORTEST):
        for signal, full, sigma in (
            (speed[part], float(np.linalg.norm(usual[:2])), float(noise[:2].max())),
            (turning[part], float(usual[5]), float(noise[5])),
        ):
            good = signal[np.isfinite(signal)]
            if len(good) < 5 or full <= 0.0:
                continue
            # The first second belongs to what went before: thrusters that run down, a turn that ends.
            later = signal[np.searchsorted(run.t[part], run.t[part][0] + 1.0) :]
            low = np.minimum.accumulate(np.where(np.isfinite(later), later, np.inf))
            gain = np.where(np.isfinite(later), later, -np.inf) - low
            if len(gain) and gain.max() > max(_GAIN * full, 8.0 * sigma):
                out.append(_stretch(run, part, "moved"))
                break
    return out


def _drifting(run: Run, level: Array, noise: Array) -> list[Stretch]:
    """Find steady motion over ground that is left long after the last command."""
    world = rotate(run.quaternion, run.nu[:, :3])[:, :2]
    out = []
    for part in _parts(run, level < _NEUTRAL, _SETTLE):
        t = run.t[part]
        late = np.flatnonzero((t > 0.5 * (t[0] + t[-1])) & np.isfinite(world[part]).all(axis=1))
        if len(late) < 10:
            continue
        v = world[part][late]
        third = len(v) // 3
        first, last, mean = v[:third].mean(0), v[-third:].mean(0), v.mean(0)
        speed = float(np.linalg.norm(mean))
        steady = float(np.linalg.norm(last - first)) < _EASE * speed
        if steady and speed > max(_DRIFTING, 5.0 * float(noise[:3].max()) / np.sqrt(len(v))):
            out.append(_stretch(run, part, "drifting", speed))
    return out


def _stretches(run: Run, mask: Mask, kind: str, shortest: float) -> list[Stretch]:
    return [_stretch(run, part, kind) for part in _parts(run, mask, shortest)]


def _parts(run: Run, mask: Mask, shortest: float) -> list[slice]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [slice(int(a), int(b)) for a, b in pairs if run.t[b - 1] - run.t[a] >= shortest]


def _stretch(run: Run, part: slice, kind: str, value: float = 0.0) -> Stretch:
    return Stretch(kind, run.number, float(run.t[part.start]), float(run.t[part.stop - 1]), value)
