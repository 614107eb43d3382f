"""Channels of several rates brought to one set of rows, by a rule for each kind of quantity.

The rows have the times of the sensor that measures the velocities; where two sensors do, those of the slower one, for
nothing is gained by inventing velocities between its samples. To these times

- a command is held from one message to the next (or runs linearly, if the mapping says so), and a row takes its mean
  until the next row: the impulse of a command that comes faster than the rows, or between them, is kept;
- the attitude is interpolated as a rotation, faster rates and accelerations linearly, nothing across a gap;
- positions, heights and voltages that come slower than the rows stand in the nearest row and are missing in the others:
  a sample that was interpolated would count as a measurement that nobody made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.channels import ACCELERATION, EULER, QUATERNION, RESET, VELOCITY, WRENCH
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.signals.rotation import continuous
from auvnn.logs.signals.segments import GAP_STEPS

Array = NDArray[np.float64]

_SAME = 1e-6  # s; stamps that agree so well are the same sample
_SLOWER = 1.5  # times the rows' step from which a sensor counts as slower
_LONGEST_HOLD = 2.0  # s that a command is held at least, if no other follows
_HOLD_STEPS = 10.0
_BLOCK = 65_536  # rows at a time: what is needed on the way stays small


@dataclass(frozen=True)
class Series:
    """What one topic says about some canonical columns.

    Args:
        names: canonical columns.
        t: when, s, (N,), in the order of the file.
        values: (N, k), NaN for missing.
        topic: where they come from, for messages.
        arrival: when recorded, s, (N,); None where it is not known.
        event: whether it is written only when it changes, and holds until then.
    """

    names: tuple[str, ...]
    t: Array
    values: Array
    topic: str = ""
    arrival: Array | None = None
    event: bool = False

    def __post_init__(self) -> None:
        """Leave out what has no time, and rows in which everything is missing."""
        keep = np.isfinite(self.t) & np.isfinite(self.values).any(axis=1)
        if not keep.all():
            for name in ("t", "values", "arrival"):
                value = getattr(self, name)
                object.__setattr__(self, name, None if value is None else value[keep])

    @property
    def step(self) -> float:
        """Median time step, s; infinite for fewer than two samples."""
        steps = np.diff(self.t)
        steps = steps[steps > 0.0]
        return float(np.median(steps)) if len(steps) else np.inf

    def cut(self, keep: NDArray[np.bool_]) -> Series:
        """Return some of the samples."""
        arrival = None if self.arrival is None else self.arrival[keep]
        return replace(self, t=self.t[keep], values=self.values[keep], arrival=arrival)

    def sorted(self) -> Series:
        """Return the samples in order of time, of equal stamps the first."""
        if (np.diff(self.t) > 0.0).all():
            return self
        order = np.argsort(self.t, kind="stable")
        fresh = np.concatenate([[True], np.diff(self.t[order]) > 0.0])
        order = order[fresh]
        arrival = None if self.arrival is None else self.arrival[order]
        return replace(self, t=self.t[order], values=self.values[order], arrival=arrival)


def is_command(name: str) -> bool:
    """Say whether a canonical column is a command."""
    return name.startswith(("thruster_", "fin_")) or name in WRENCH


def rows_of(series: Sequence[Series], topic: str | None, where: str) -> Series:
    """Return the series whose times the rows have.

    Args:
        series: all.
        topic: that the mapping names; None to choose.
        where: file, for messages.

    Raises:
        InputError: the topic that is named gives no column, or there is nothing to choose from.
    """
    if topic is not None:
        for one in series:
            if one.topic == topic and len(one.t):
                return one
        raise InputError(f"{where}: rows: no column of the mapping comes from '{topic}'")
    full = [s for s in series if len(s.t)]
    linear = [s for s in full if set(s.names) & set(VELOCITY[:3])]
    turning = [s for s in full if set(s.names) & set(VELOCITY[3:])]
    if linear and turning:
        a, b = max(linear, key=lambda s: s.step), max(turning, key=lambda s: s.step)
        return b if b.step > _SLOWER * a.step else a
    for group in (linear or turning, *_by_name(full)):
        if group:
            return max(group, key=lambda s: s.step) if group is (linear or turning) else group[0]
    raise InputError(f"{where}: none of the columns has a sample with a time")


def _by_name(series: list[Series]) -> list[list[Series]]:
    order = (QUATERNION + EULER, ("z", "x", "y"))
    return [[s for s in series if set(s.names) & set(names)] for names in order] + [series]


def merge(
    series: list[Series], rows: Series, where: str, between: str = "held", longest: float | None = None
) -> tuple[dict[str, Array], list[Repair]]:
    """Return columns at the rows' times, `t` first, and what was done.

    Args:
        series: all, that of the rows among them; the list is empty afterwards, so that each is given up as it is done.
        rows: see `rows_of`.
        where: file, for messages.
        between: commands between their messages: "held" or "linear".
        longest: s that a command holds without another; None: ten of its steps, 2 s at least.
    """
    rows = rows.sorted()
    t = rows.t
    step = rows.step
    out: dict[str, Array] = {"t": t}
    repairs: list[Repair] = []
    series.reverse()
    while series:
        one = series.pop()
        if one.topic == rows.topic and one.names == rows.names:
            values = rows.values
        else:
            values = _at(one.sorted(), t, step, between, longest, where, repairs)
        for name, column in zip(one.names, values.T, strict=True):
            out[name] = column
    return out, repairs


def _at(
    one: Series, t: Array, step: float, between: str, longest: float | None, where: str, repairs: list[Repair]
) -> Array:
    if len(one.t) == 0:
        return np.full((len(t), len(one.names)), np.nan)
    if is_command(one.names[0]):
        return _commands(one, t, step, between, longest, where, repairs)
    if one.names[0] in (RESET, "run"):
        return one.values[np.clip(np.searchsorted(one.t, t + _SAME, side="right") - 1, 0, None)]
    if len(one.t) == len(t) and np.abs(one.t - t).max() <= _SAME:
        return one.values
    attitude = one.names == QUATERNION
    velocity = set(one.names) & set(VELOCITY + ACCELERATION)
    if one.step > _SLOWER * step and not attitude and not velocity:
        return _nearest(one, t, step)
    if one.step > _SLOWER * step:
        words = f"{'attitude' if attitude else ', '.join(one.names)} at {1 / one.step:.3g} Hz interpolated"
        repairs.append(
            Repair(f"{words} to rows at {1 / step:.3g} Hz", f"{where}, {one.topic}", len(t), "warning")
        )
    values = continuous(one.values) if attitude else one.values
    result = linear(one.t, values, t, GAP_STEPS * max(one.step, step))
    if attitude:
        norm = np.linalg.norm(result, axis=1, keepdims=True)
        # Between two attitudes the straight line cuts the corner of the unit sphere.
        result = np.where(np.abs(norm - 1.0) > 1e-9, result / norm, result)
    return result


def linear(t: Array, values: Array, wanted: Array, gap: float) -> Array:
    """Return values (N, k) at other times, linear, exact where the times agree, NaN across gaps and beyond the ends.

    Args:
        t: increasing, s, (N,).
        values: (N, k).
        wanted: s, (M,).
        gap: longest step that is interpolated, s.
    """
    right = np.clip(np.searchsorted(t, wanted - _SAME), 0, len(t) - 1)
    same = np.abs(t[right] - wanted) <= _SAME
    left = np.where(same, right, np.maximum(right - 1, 0))
    span = t[right] - t[left]
    share = np.where(span > 0.0, (wanted - t[left]) / np.where(span > 0.0, span, 1.0), 0.0)
    out = values[left] + share[:, None] * (values[right] - values[left])
    lost = (wanted < t[0] - _SAME) | (wanted > t[-1] + _SAME) | (span > gap)
    out[lost] = np.nan
    return np.where(same[:, None], values[right], out)


def _nearest(one: Series, t: Array, step: float) -> Array:
    out = np.full((len(t), len(one.names)), np.nan)
    row = np.clip(np.searchsorted(t, one.t), 1, len(t) - 1)
    row = np.where(one.t - t[row - 1] < t[row] - one.t, row - 1, row)
    near = np.abs(t[row] - one.t) <= 0.5 * step + _SAME
    out[row[near]] = one.values[near]
    return out


def _commands(
    one: Series, t: Array, step: float, between: str, longest: float | None, where: str, repairs: list[Repair]
) -> Array:
    """Return the mean of each command from a row to the next."""
    hold = longest if longest is not None else max(_LONGEST_HOLD, _HOLD_STEPS * one.step)
    if between == "held" and len(one.t) == len(t) and np.abs(one.t - t).max() <= _SAME:
        return one.values  # each row has its own command, from its time to the next row's
    out = np.empty((len(t), one.values.shape[1]))
    lost, none = np.zeros(len(t), dtype=bool), np.zeros(len(t), dtype=bool)
    for at in range(0, len(t), _BLOCK):
        rows = slice(at, at + _BLOCK)
        here = t[rows]
        end = np.append(t[at + 1 : at + len(here) + 1], [t[-1] + step] if at + len(here) == len(t) else [])
        end = np.minimum(end, here + GAP_STEPS * step)
        before = np.searchsorted(one.t, here + _SAME, side="right") - 1
        start = np.clip(before, 0, None)
        if between == "linear":
            out[rows] = linear(one.t, one.values, here, max(hold, GAP_STEPS * one.step))
        else:
            out[rows] = _means(one, here, end, start)
        none[rows] = before < 0
        old = here - one.t[start] > hold
        lost[rows] = none[rows] | (old & (not one.event or longest is not None))
    if lost.any() and not lost.all():
        words = f"rows without a command for {hold:.3g} s read as missing"
        cure = "if commands are sent only when they change: commands: {longest: 60} in the mapping"
        if (lost & ~none).any():
            repairs.append(Repair(words, f"{where}, {one.topic}", int(lost.sum()), "warning", cure))
    out[lost] = np.nan
    return out


def _means(one: Series, t: Array, end: Array, start: NDArray[np.intp]) -> Array:
    """Return the mean of held commands (M, k) from each time to its end.

    Args:
        one: the commands' messages.
        t: begin, s, (M,).
        end: s, (M,).
        start: number of the message that holds at each begin, (M,).
    """
    inside = np.searchsorted(one.t, end - _SAME, side="left") - 1
    out = one.values[start]
    mixed = inside > start
    if mixed.any():
        # The integral of a held command is linear between its messages.
        first, last = int(start[mixed].min()), int(inside[mixed].max()) + 1
        times, values = one.t[first:last], one.values[first:last]
        steps = np.cumsum(np.diff(times)[:, None] * values[:-1], axis=0)
        grown = np.concatenate([np.zeros((1, values.shape[1])), steps])
        a, b = start[mixed] - first, inside[mixed] - first
        begin = np.maximum(t[mixed], one.t[0])
        whole = (grown[b] + (end[mixed] - times[b])[:, None] * values[b]) - (
            grown[a] + (begin - times[a])[:, None] * values[a]
        )
        out[mixed] = whole / (end[mixed] - begin)[:, None]
    return out


def sparse(columns: dict[str, Array], required: Sequence[str], most: float) -> bool:
    """Say whether a table holds sensors of several rates: more than a share of some required column is missing.

    Args:
        columns: by name, (N,) each.
        required: names that are looked at.
        most: share of missing samples up to which a column counts as full.
    """
    return any(float(np.isnan(columns[n]).mean()) > most for n in required if n in columns)


def of_table(columns: dict[str, Array]) -> list[Series]:
    """Return the columns of a table as series, those together that are measured in the same rows."""
    t = columns["t"]
    groups: dict[bytes, list[str]] = {}
    for name, column in columns.items():
        if name == "t" or np.isnan(column).all():
            continue
        kind = "quaternion" if name in QUATERNION else "euler" if name in EULER else _kind(name)
        groups.setdefault(kind.encode() + np.packbits(np.isfinite(column)).tobytes(), []).append(name)
    out = []
    for names in groups.values():
        keep = np.isfinite(columns[names[0]])
        values = np.stack([columns[n][keep] for n in names], axis=1)
        out.append(Series(tuple(names), t[keep], values, ", ".join(names[:3])))
    return out


def _kind(name: str) -> str:
    return "command" if is_command(name) else "reset" if name == RESET else "state"
