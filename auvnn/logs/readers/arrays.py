"""Files of named arrays (MATLAB, HDF5, NetCDF) seen as topics: arrays of a group that are as long share their times."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic

_TIMES = ("t", "time", "Time", "timestamp", "Timestamp", "stamp", "times", "TIME", "time_s", "tout")
_MOST_COLUMNS = 64
MIN_ROWS = 3


def to_recording(arrays: Mapping[str, NDArray], where: str, repairs: list[Repair]) -> Recording:
    """Return arrays by path (`odom.u`) as topics by group (`odom`), those of the whole file as the topic "".

    A matrix with its time along the longer side gives columns `nu[0]`, `nu[1]`, ...; a group without a time of its own
    takes that of the group above it, or of the whole file, if it is as long.

    Args:
        arrays: of any shape, by path.
        where: of the file, for messages.
        repairs: to which notes are added.

    Raises:
        InputError: there are no arrays of numbers of at least three values.
    """
    groups: dict[str, dict[str, NDArray]] = {}
    for path, values in arrays.items():
        group, _, name = path.rpartition(".")
        array = np.squeeze(np.asarray(values))
        if array.ndim in (1, 2) and max(array.shape, default=0) >= MIN_ROWS and array.dtype.kind in "iufb":
            groups.setdefault(group, {})[name] = array
    if not groups:
        raise InputError(
            f"{where}: holds no arrays of numbers; save the signals as plain arrays, and their time as t"
        )
    topics: dict[str, Topic] = {}
    left: list[str] = []
    for group, members in groups.items():
        topics |= _of_group(group, members, groups, left)
    if left:
        words = f"arrays without a time of their length left out: {', '.join(left[:8])}" + (
            ", ..." if len(left) > 8 else ""
        )
        repairs.append(Repair(words, where, len(left), "info"))
    if not topics:
        raise InputError(
            f"{where}: no array is called as a time is ({', '.join(_TIMES[:4])}) and as long as others; name it so: the "
            f"file has {', '.join(list(arrays)[:12])}"
        )
    return Recording(topics, repairs)


def _of_group(
    group: str, members: dict[str, NDArray], groups: dict[str, dict[str, NDArray]], left: list[str]
) -> dict[str, Topic]:
    times = _times(members)
    above = group
    while above:
        above = above.rpartition(".")[0]
        for length, found in _times(groups.get(above, {})).items():
            times.setdefault(length, found)
    by_length: dict[int, dict[str, NDArray]] = {}
    for name, array in members.items():
        length = next((n for n in (*array.shape[:1], *array.shape[1:]) if n in times), 0)
        if not length:
            left.append(f"{group}.{name}" if group else name)
            continue
        columns = by_length.setdefault(length, {})
        if array.ndim == 1:
            columns[name] = array
            continue
        matrix = array if array.shape[0] == length else array.T
        for i in range(min(matrix.shape[1], _MOST_COLUMNS)):
            columns[f"{name}[{i}]"] = np.ascontiguousarray(matrix[:, i])
    out = {}
    for length, columns in by_length.items():
        name, t = times[length]
        columns.setdefault("t", t)
        topic = group if len(by_length) == 1 else f"{group}({length})" if group else f"({length})"
        clean = {k: _clean(v) for k, v in columns.items()}
        out[topic] = Topic(topic, "array", _seconds(t), clean)
    return out


def _times(members: Mapping[str, NDArray]) -> dict[int, tuple[str, NDArray]]:
    found: dict[int, tuple[str, NDArray]] = {}
    for name in _TIMES:
        array = members.get(name)
        if array is not None and array.ndim == 1:
            found.setdefault(len(array), (name, array))
    for name, array in members.items():
        if array.ndim == 1 and re.fullmatch(r"(t|time)_\w+|\w+_(t|time)", name):
            found.setdefault(len(array), (name, array))
    return found


def _seconds(t: NDArray) -> NDArray[np.float64]:
    if t.dtype.kind in "iu":
        return (t - t[0]).astype(np.float64)
    return t.astype(np.float64)


def _clean(values: NDArray) -> NDArray:
    if values.dtype.kind == "i" and values.dtype.itemsize == 8:
        return values
    numbers = values.astype(np.float64, copy=False)
    bad = np.isinf(numbers)
    return np.where(bad, np.nan, numbers) if bad.any() else numbers
