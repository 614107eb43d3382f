"""What is wrong with one run among others: pooled figures hide it, because the good runs outvote it.

Three questions for each run. Does each velocity follow the derivative of attitude or position there, as it does in the
other runs? Does the velocity, turned into the world by the heading, point where the position goes? Were headings
averaged across the place where they wrap, which puts samples on the far side of the circle?
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.quality.finding import Finding
from auvnn.logs.quality.kinematic_pairs import velocities
from auvnn.logs.quality.kinematics import Agreement
from auvnn.logs.run import Run
from auvnn.logs.signals.rotation import rotate

if TYPE_CHECKING:
    from auvnn.logs.log import Log

Array = NDArray[np.float64]
# Correlation below which a run is told apart from others that agree, and that of those others.
LOOSE, GOOD = 0.7, 0.8
# A heading that is off by less, rad, is within what mountings and lags do; and it must be beyond so many standard errors.
OFF, SURE = 0.1, 5.0
# Correlation of horizontal velocity and change of position, once turned, from which on the turn is believed.
TURNED = 0.8
# Blocks of a run by whose spread the uncertainty of its heading is found.
BLOCKS = 10
# Samples that lie this far, rad, from neighbours that are on either side of the wrap.
WRAP, FAR = 0.8, 0.6


def by_run(log: Log, agreement: dict[str, Agreement]) -> list[Finding]:
    """Return the findings that concern single runs.

    Args:
        log: the log.
        agreement: of velocities with attitude and position, all runs pooled and each.
    """
    return [*_disagreeing(agreement), *_headings(log), *(f for run in log.runs for f in _wrapped(run))]


def _disagreeing(agreement: dict[str, Agreement]) -> list[Finding]:
    """Return a warning for each run in which a velocity does not follow what it follows in the others."""
    bad: dict[int, list[str]] = {}
    for name, found in agreement.items():
        moving = [(n, s, c) for n, s, c, moves in found.runs if moves and np.isfinite(c)]
        if len(moving) < 2:
            continue
        for number, scale, correlation in moving:
            others = [c for n, _, c in moving if n != number]
            pooled = float(np.median(np.abs(others)))
            same = np.sign(np.median(others))
            if pooled < GOOD:
                continue
            if same * correlation < 0 and abs(correlation) >= LOOSE:
                bad.setdefault(number, []).append(f"{name} has the opposite sign there (scale {scale:.2f})")
            elif abs(correlation) < LOOSE:
                words = f"{name} correlates with it by {correlation:.2f} (other runs: {pooled:.2f})"
                bad.setdefault(number, []).append(words)
    cure = "look at this run alone; leave it out, or correct its clock, headings or signs"
    return [
        Finding(
            "warning",
            f"run {number}",
            f"against the derivative of attitude and position {'; '.join(words)}",
            cure,
        )
        for number, words in sorted(bad.items())
    ]


def heading_offset(run: Run) -> tuple[float, float, float] | None:
    """Return by how much the heading of a run is off against its position, its standard error, and the correlation.

    The measured velocity, turned into the world by the attitude, and the derivative of the position are taken as complex
    numbers north + i east. Their cross-moment has the angle by which the heading would have to be raised, rad.
    """
    pair = velocities(run)
    if pair is None:
        return None
    good = (
        np.isfinite(pair.derived).all(1)
        & np.isfinite(pair.measured).all(1)
        & np.isfinite(run.quaternion).all(1)
    )
    if good.sum() < 10 * BLOCKS:
        return None
    q = run.quaternion[good]
    moved, seen = (rotate(q, x[good])[:, :2] @ np.array([1.0, 1.0j]) for x in (pair.derived, pair.measured))
    cross = np.conj(seen) * moved
    size = float(np.sqrt((np.abs(seen) ** 2).sum() * (np.abs(moved) ** 2).sum()))
    if size <= 0.0 or np.sqrt(np.mean(np.abs(moved) ** 2)) < 3.0 * max(
        np.nan_to_num(pair.derived_noise).max(), 1e-6
    ):
        return None
    total = cross.sum()
    without = [np.angle((total - part.sum()) * np.conj(total)) for part in np.array_split(cross, BLOCKS)]
    std = float(np.sqrt((BLOCKS - 1) / BLOCKS * np.sum((np.array(without) - np.mean(without)) ** 2)))
    return float(np.angle(total)), std, float(np.abs(total) / size)


def _headings(log: Log) -> list[Finding]:
    found = {}
    for run in log.runs:
        offset = heading_offset(run)
        if offset is not None and offset[2] >= TURNED:
            found[run.number] = offset
    if not found:
        return []
    # What all runs share is a sensor that is turned in its mounting; a separate run is judged against the others.
    shared = np.angle(np.mean([np.exp(1j * a) for a, _, _ in found.values()])) if len(found) > 2 else 0.0
    if len(found) > 2:
        angles = np.array([a for a, _, _ in found.values()])
        around = np.angle(np.exp(1j * (angles - shared)))
        shared = float(np.angle(np.exp(1j * (shared + np.median(around)))))
    out = []
    for number, (angle, std, _) in found.items():
        off = float(np.angle(np.exp(1j * (angle - shared))))
        if abs(off) > max(OFF, SURE * std):
            out.append(
                Finding(
                    "warning",
                    f"run {number}",
                    f"heading is off by {-off:+.2f} +- {std:.2f} rad against the way that its position goes",
                    f"add {off:+.2f} rad to psi of this run (a compass that was not aligned), or leave its position out",
                )
            )
    if abs(shared) > OFF and len(found) > 2:
        cure = "a velocity sensor that is turned about z: try the effect velocity_misalignment, or turn it in the mapping"
        out.append(
            Finding(
                "warning", "heading", f"in all runs velocity and position differ by {shared:+.2f} rad", cure
            )
        )
    return out


def _wrapped(run: Run) -> list[Finding]:
    """Return a finding where headings lie on the far side of the circle between neighbours at its wrap."""
    psi = run.euler[:, 2]
    before, here, after = psi[:-2], psi[1:-1], psi[2:]
    at_wrap = (
        (np.abs(before) > np.pi - WRAP) & (np.abs(after) > np.pi - WRAP) & (np.sign(before) != np.sign(after))
    )
    count = int((at_wrap & (np.abs(here) < np.pi - WRAP - FAR)).sum())
    if not count:
        return []
    times = "one heading lies" if count == 1 else f"{count} headings lie"
    what = (
        f"{times} far from neighbours at -pi and pi: angles were averaged or interpolated across their wrap"
    )
    cure = "unwrap headings before they are filtered or resampled, or leave these samples empty"
    return [Finding("warning", f"run {run.number}", what, cure)]
