"""Time stamps put in order: what cannot be a time is dropped, what runs backwards is sorted or split."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import MIN_SAMPLES

Array = NDArray[np.float64]

SORT_LIMIT = 1.0  # s; a larger step back is a clock that was set or a recording that was restarted
_SLOWEST, _FASTEST = 5.0, 1e-5  # s per sample beyond which the unit is doubted
_UNIX = 1e8  # s; stamps beyond it are dates
_SHUFFLED = 0.25  # share of steps back that no recording has
_OVERLAP = 0.6  # share of the median step below which two sorted stamps count as interleaved


def order_in_time(t: Array, where: str) -> tuple[list[NDArray[np.intp]], list[Repair]]:
    """Return the rows of each stretch in increasing time, without repeated stamps.

    Stamps that are missing are dropped, as are leading zeros before a clock that counts from 1970. A step
    back of at most 1 s is sorted (stable); a larger one, or one after which the clock runs through a time
    that it has shown before, begins a further stretch. Of equal stamps the first is kept.

    Args:
        t: stamps in the order of the file, s, (N,).
        where: file and run, for the messages.

    Returns:
        Row numbers of each stretch (at least one), and what was done.

    Raises:
        InputError: too few stamps, or a median step that no log has.
    """
    repairs: list[Repair] = []
    finite = len(t) >= MIN_SAMPLES and np.isfinite(t[[0, -1]]).all()
    if finite and (np.diff(t) > 0.0).all() and (t[-1] <= _UNIX or t[0] != 0.0):
        _plausible(t, where)
        return [np.arange(len(t))], repairs  # in order already, as most logs are
    rows = np.flatnonzero(np.isfinite(t))
    _note(repairs, "samples without a time stamp dropped", where, len(t) - len(rows))
    if len(rows) and t[rows].max() > _UNIX:
        started = np.flatnonzero(t[rows] != 0.0)
        leading = int(started[0]) if len(started) else 0
        _note(repairs, "samples with stamp 0 before the clock started dropped", where, leading)
        rows = rows[leading:]
    if len(rows) < MIN_SAMPLES:
        raise InputError(
            f"{where}: {len(rows)} samples with a time stamp; a run needs at least {MIN_SAMPLES}"
        )
    _plausible(t[rows], where)
    stretches = [_sorted(t, part) for part in _split(t, rows)]
    steps = np.diff(t[rows])
    back = steps[steps < 0.0]
    if len(back):
        largest = -float(back.min())
        if len(stretches) > 1:
            words = f"time runs backwards (by up to {largest:.4g} s): split into further runs"
            cure = "join only recordings of one clock, or give each its own run number"
            repairs.append(Repair(words, where, len(stretches) - 1, "warning", cure))
        inside = int(sum((np.diff(t[part]) < 0.0).sum() for part in _split(t, rows)))
        words = f"samples out of order sorted by time (largest step back {largest:.4g} s)"
        _note(repairs, words, where, inside)
    result = []
    repeated = lost = 0
    for part in stretches:
        fresh = np.concatenate([[True], np.diff(t[part]) > 0.0])
        repeated += int((~fresh).sum())
        if fresh.sum() >= MIN_SAMPLES:
            result.append(part[fresh])
        else:
            lost += int(fresh.sum())
    _note(repairs, "samples with a repeated time stamp dropped (the first is kept)", where, repeated)
    _note(repairs, f"samples in stretches of fewer than {MIN_SAMPLES} dropped", where, lost)
    if not result:
        raise InputError(f"{where}: no stretch of at least {MIN_SAMPLES} samples with different time stamps")
    return result, repairs


def _plausible(t: Array, where: str) -> None:
    steps = np.diff(t)
    forward = steps[steps > 0.0]
    if len(forward) == 0:
        raise InputError(f"{where}: all samples have the same time stamp t = {t[0]:.6g} s")
    if t.max() > _UNIX and len(forward) < 0.5 * len(steps):
        raise InputError(
            f"{where}: {len(steps) - len(forward)} of {len(steps)} time steps are zero at t = {t[0]:.6g} s: "
            "a date stored in 32 bits resolves 128 s; store t as float64, or count it from the start"
        )
    back = -steps[steps < 0.0]
    if len(back) > _SHUFFLED * len(steps) and float(np.median(back)) > SORT_LIMIT:
        raise InputError(
            f"{where}: the rows are not in the order of time: {len(back)} of {len(steps)} steps go back, half of them by "
            f"more than {float(np.median(back)):.3g} s; sort the file by t, or give each recording its own run number"
        )
    step = float(np.median(forward))
    if step > _SLOWEST:
        unit = min((1e3, "ms"), (1e6, "us"), (1e9, "ns"), key=lambda u: abs(np.log(step / u[0] / 0.05)))[1]
        raise InputError(
            f"{where}: median time step {step:.4g} s: is t in {unit}? Mapping: time: {{unit: {unit}}}"
        )
    if step < _FASTEST:
        raise InputError(
            f"{where}: median time step {step:.4g} s: t must be in seconds; was it scaled twice? "
            "Check time: {unit: ...} in the mapping"
        )


def _split(t: Array, rows: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    stamps = t[rows]
    steps = np.diff(stamps)
    typical = float(np.median(steps[steps > 0.0]))
    cuts = [
        int(i) + 1
        for i in np.flatnonzero(steps < 0.0)
        if -steps[i] > SORT_LIMIT or _repeats_time(stamps, int(i) + 1, typical)
    ]
    return np.split(rows, cuts)


def _repeats_time(stamps: Array, at: int, typical: float) -> bool:
    """Say whether the clock, set back before sample `at`, runs again through a time already recorded."""
    reach = int(np.ceil(SORT_LIMIT / typical)) + 1
    near = stamps[max(0, at - reach) : at + reach]
    before = stamps[max(0, at - reach) : at]
    after = stamps[at : at + reach]
    low, high = after.min(), before.max()
    again = near[(near >= low) & (near <= high)]
    if min((before >= low).sum(), (after <= high).sum()) < 3:
        return False
    # Late samples fill a hole when sorted; a repeated time leaves two samples where one belongs.
    return float((np.diff(np.sort(again)) < _OVERLAP * typical).mean()) >= 0.4


def _sorted(t: Array, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    stamps = t[rows]
    if (np.diff(stamps) >= 0.0).all():
        return rows
    return rows[np.argsort(stamps, kind="stable")]


def _note(repairs: list[Repair], words: str, where: str, count: int) -> None:
    if count:
        repairs.append(Repair(words, where, count))
