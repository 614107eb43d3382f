"""Topics whose stamps are another computer's: the offset of the clocks, found by what both have measured.

Whatever the frame, the speed of turning |omega| and the speed |v| are the same for all sensors on one body: those of the
topic in question are correlated with those of the other topics over a range of shifts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.channels import POSITION, QUATERNION, VELOCITY
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.signals import differences, lags

if TYPE_CHECKING:
    from auvnn.logs.reading.mapping_file.mapping_more import TopicRule
    from auvnn.logs.reading.recordings.rates import Series

Array = NDArray[np.float64]

_RATE = 20.0  # Hz of the common grid on which speeds are compared
_LONGEST = 120.0  # s of shift that is looked at beyond what the first stamps suggest
_MOST = 60_000
_STEP, _REACH = 0.02, 60  # s, and steps to either side, of the second look


def align(series: list[Series], rules: Mapping[str, TopicRule], where: str, repairs: list[Repair]) -> None:
    """Shift the times of the topics whose offset is to be found; `series` is changed in place.

    Raises:
        InputError: what such a topic measured has nothing in common with the others, or no shift stands out.
    """
    for name in rules:
        mine = [s for s in series if s.topic == name]
        others = [s for s in series if s.topic not in rules and len(s.t)]
        if not mine:
            continue
        offset = _offset(mine, others)
        if offset is None:
            raise InputError(
                f"{where}: topics: {name}: offset: auto finds none: its motion and that of the other topics agree at no "
                "shift beyond doubt; give the offset in seconds"
            )
        value, low, high = offset
        for i, one in enumerate(series):
            if one.topic == name:
                series[i] = replace(one, t=one.t + value)
        words = f"clock of '{name}' set by {value:.4f} s, which its motion says (95 % within {low:.3f} to {high:.3f} s)"
        repairs.append(Repair(words, where, 1, "info"))


def _offset(mine: Sequence[Series], others: Sequence[Series]) -> tuple[float, float, float] | None:
    a, b = _speeds(mine), _speeds(others)
    for kind in ("turning", "moving"):
        if kind in a and kind in b:
            found = _shift(*a[kind], *b[kind])
            if found is not None:
                return found
    return None


def _speeds(series: Sequence[Series]) -> dict[str, tuple[Array, Array]]:
    """Return times and speeds of turning, rad/s, and of moving, m/s, measured ones before derived."""
    found: dict[str, tuple[Array, Array]] = {}
    for one in series:
        one = one.sorted()
        if one.names == VELOCITY[3:]:
            found["turning"] = one.t, np.linalg.norm(one.values, axis=1)
        elif one.names == VELOCITY[:3]:
            found["moving"] = one.t, np.linalg.norm(one.values, axis=1)
    for one in series:
        one = one.sorted()
        if one.names == QUATERNION and "turning" not in found and len(one.t) > 2:
            t, rate = differences.of_attitudes(one.t, one.values)
            found["turning"] = t, np.linalg.norm(rate, axis=1)
        elif one.names == POSITION and "moving" not in found and len(one.t) > 2:
            t, rate = differences.of_positions(one.t, one.values)
            found["moving"] = t, np.linalg.norm(rate, axis=1)
    return found


def _shift(ta: Array, a: Array, tb: Array, b: Array) -> tuple[float, float, float] | None:
    if min(len(ta), len(tb)) < 50:
        return None
    first = float(tb[0] - ta[0])  # as if both had begun together
    dt = 1.0 / _RATE
    begin = min(ta[0] + first, tb[0])
    count = int(min((max(ta[-1] + first, tb[-1]) - begin) / dt + 1, _MOST))
    grid = begin + dt * np.arange(count)
    x = _on_grid(tb, b, grid)
    y = _on_grid(ta + first, a, grid)
    lag = lags.other_clock([(x[:, None], y[:, None])], dt, _LONGEST)
    if lag is None:
        return None
    # y is late by lag: its stamps are that much too large.
    value = _refined(ta, a, tb, b, first - lag.value)
    half = 0.5 * (lag.high - lag.low)
    return value, value - half, value + half


def _refined(ta: Array, a: Array, tb: Array, b: Array, offset: float) -> float:
    """Return the offset near a first one at which the correlation of what overlaps is largest.

    The correlation over the whole record leans towards shifts at which more overlaps; here each shift is judged by the
    samples that it brings together alone.
    """
    shifts = offset + _STEP * np.arange(-_REACH, _REACH + 1)
    found = np.full(len(shifts), -1.0)
    for i, shift in enumerate(shifts):
        inside = (ta + shift >= tb[0]) & (ta + shift <= tb[-1])
        if inside.sum() > max(0.5 * len(ta), 50):
            x, y = a[inside], np.interp(ta[inside] + shift, tb, b)
            if x.std() > 0.0 and y.std() > 0.0:
                found[i] = float(np.corrcoef(x, y)[0, 1])
    best = int(np.clip(found.argmax(), 1, len(shifts) - 2))
    left, middle, right = found[best - 1 : best + 2]
    bend = left - 2.0 * middle + right
    part = 0.5 * (left - right) / bend if bend < 0.0 and min(left, right) > -1.0 else 0.0
    return float(shifts[best] + part * _STEP)


def _on_grid(t: Array, x: Array, grid: Array) -> Array:
    good = np.isfinite(x)
    smooth = np.interp(grid, t[good], x[good])
    smooth[(grid < t[good][0]) | (grid > t[good][-1])] = float(np.mean(x[good]))
    return smooth
