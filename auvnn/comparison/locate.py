"""Where a model fails: the residual wrench by degree of freedom and regime."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import Failure
from auvnn.logs import Log, Run
from auvnn.metrics.one_step import OneStep

Array = NDArray[np.float64]
AXES = ("X", "Y", "Z", "K", "M", "N")
WORDS = {"X": "surge", "Y": "sway", "Z": "heave", "K": "roll", "M": "pitch", "N": "yaw"}
BINS = 6
# Energy above the noise floor, as a share of it, up to which the floor itself may be off: not a failure yet.
BARELY = 0.3
UNITS = {
    "speed": "m/s",
    "turn rate": "rad/s",
    "attitude": "rad",
    "heading": "rad",
    "command": "of the largest",
    "depth": "m",
    "time": "s",
}


def regimes(run: Run) -> dict[str, Array]:
    """Return what a run's residual is sorted by, each (N,), in the units of `UNITS`."""
    found = {
        "speed": np.linalg.norm(run.nu[:, :3], axis=1),
        "turn rate": np.linalg.norm(run.nu[:, 3:], axis=1),
        # Angle between the body's and the world's vertical: roll and pitch in one.
        "attitude": np.arccos(
            np.clip(1 - 2 * (run.quaternion[:, 1] ** 2 + run.quaternion[:, 2] ** 2), -1, 1)
        ),
        "heading": run.euler[:, 2],
        "time": run.t - run.t[0],
    }
    if run.command is not None:
        size = np.linalg.norm(run.command, axis=1)
        top = np.nanmax(size) if np.isfinite(size).any() else 0.0
        found["command"] = size / top if top > 0 else size
    if run.position is not None:
        found["depth"] = run.position[:, 2]
    return found


class Regime(TypedDict):
    """The residual sorted by one quantity: the bins' edges in `unit`, its rms, (6, bins), and the samples by bin."""

    edges: list[float]
    unit: str
    rms: Array
    count: NDArray[np.intp]


def locate(log: Log, parts: list[OneStep]) -> dict[str, Regime]:
    """Return by regime the bins' edges, the residual's root mean square (6, bins) and the samples in each bin."""
    values = [regimes(run) for run in log.runs]
    wrench = np.concatenate([p.wrench for p in parts])
    # Degrees of freedom without a sensor have no residual.
    told = np.isfinite(wrench[:, np.isfinite(wrench).any(0)]).all(1)
    found: dict[str, Regime] = {}
    for name in UNITS:
        if not all(name in v for v in values):
            continue
        x = np.concatenate([v[name] for v in values])
        good = np.isfinite(x) & told
        if good.sum() < 10 * BINS or np.ptp(x[good]) < 1e-9:
            continue
        if name in ("heading", "time", "depth"):
            edges = np.linspace(x[good].min(), x[good].max(), BINS + 1)
        else:
            # Bins of equal content: speeds and angles crowd near zero.
            edges = np.unique(np.quantile(x[good], np.linspace(0, 1, BINS + 1)))
        if len(edges) < 3:
            continue
        index = _bins(x[good], edges)
        count = np.bincount(index, minlength=len(edges) - 1)
        total = np.stack(
            [np.bincount(index, weights=wrench[good, k] ** 2, minlength=len(edges) - 1) for k in range(6)]
        )
        with np.errstate(invalid="ignore", divide="ignore"):
            found[name] = {
                "edges": edges.tolist(),
                "unit": UNITS[name],
                "rms": np.sqrt(total / count),
                "count": count,
            }
    return found


def members(run: Run, located: Mapping[str, Regime], name: str, number: int) -> NDArray[np.bool_]:
    """Return which samples of a run lie in one bin of one regime, (N,).

    Args:
        run: the run.
        located: what `locate` returned, for the edges.
        name: of the regime.
        number: of the bin, from 0.
    """
    x = regimes(run)[name]
    good = np.isfinite(x)
    inside = np.zeros(len(x), dtype=bool)
    inside[good] = _bins(x[good], np.asarray(located[name]["edges"], dtype=float)) == number
    return inside


def _bins(x: Array, edges: Array) -> NDArray[np.intp]:
    """Return the number of each value's bin; what lies outside all counts to the nearest."""
    return np.clip(np.digitize(x, edges[1:-1]), 0, len(edges) - 2)


def failures(
    parts: list[OneStep], located: Mapping[str, Regime], floor: Array, limit: int = 8
) -> list[Failure]:
    """Return where the error sits, in plain words, largest first.

    A place's share is what its bin holds of the residual's energy above the noise floor, all six degrees of
    freedom together, forces and moments made comparable by their floors. Degrees of freedom whose residual is
    about as large as noise alone leaves it are left out.

    Args:
        parts: comparison one step ahead, run by run.
        located: residual by bins of each quantity, as `locate` returns them.
        floor: standard deviation that noise alone leaves in the residual, (6,), N and N m.
        limit: most places that are named.
    """
    wrench = np.concatenate([p.wrench for p in parts])
    unit = np.where(floor > 0, floor, 1e-9)
    with warnings.catch_warnings():
        # A degree of freedom without a sensor has no residual to take the mean of.
        warnings.simplefilter("ignore", RuntimeWarning)
        energy = np.nanmean((wrench / unit) ** 2, axis=0) - 1.0
    energy = np.where(energy > BARELY, energy, 0.0)
    whole = float(energy.sum())
    if not np.isfinite(whole) or whole <= 0:
        return []
    samples = len(wrench)
    found: list[Failure] = []
    for k, axis in enumerate(AXES):
        if energy[k] == 0.0:
            continue
        share = energy[k] / whole
        if share >= 0.01:
            found.append({"channel": axis, "where": f"{WORDS[axis]}, everywhere", "share": float(share)})
        for name, place in located.items():
            above = np.maximum((place["rms"][k] / unit[k]) ** 2 - 1.0, 0.0) * place["count"]
            if not np.isfinite(above).any() or np.nansum(above) <= 0:
                continue
            at = int(np.nanargmax(above))
            density = (above[at] / max(place["count"][at], 1)) / max(
                np.nansum(above) / place["count"].sum(), 1e-30
            )
            if density > 1.5 and above[at] / samples / whole >= 0.01:
                low, high = place["edges"][at], place["edges"][at + 1]
                found.append(
                    {
                        "channel": axis,
                        "where": f"{WORDS[axis]}, {name} from {low:.3g} to {high:.3g} "
                        f"{place['unit']}: {density:.1f} times its average",
                        "share": float(above[at] / samples / whole),
                    }
                )
    return sorted(found, key=lambda f: -f["share"])[:limit]
