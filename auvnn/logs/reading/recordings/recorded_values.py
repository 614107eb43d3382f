"""Values of one topic of a recording: the field that a mapping names, or that of the estimator in use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.recording import PRIMARY, Recording, Topic

if TYPE_CHECKING:
    pass


def status_of(path: str) -> str:
    """Return the message that says which core of an ArduPilot estimator is in use: of EKF3 `XKF4`, of EKF2 `NKF4`."""
    return "NKF4" if path.startswith("NK") else "XKF4"


def _held(other: Topic, field: str, topic: Topic) -> NDArray[Any]:
    """Return a column of another topic at this one's times, held from one message to the next."""
    order = np.argsort(other.t, kind="stable")
    at = np.searchsorted(other.t[order], topic.t + 1e-6, side="right") - 1
    values = other.columns[field][order].astype(np.float64)[np.clip(at, 0, None)]
    return np.where(at >= 0, values, np.nan)


def _primary(recording: Recording, path: str, plan: Mapping, where: str) -> tuple[Topic, str]:
    """Return topic and column, of `XKF1[primary].VN` those of the estimator's core that is in use at each time."""
    mark = f"[{PRIMARY}]"
    if mark not in path:
        return recording.find(path, where, plan.where)
    name = path[: path.index(mark)]
    whole = recording.topics.get(name + mark)
    if whole is None:
        cores = recording.instances(name) or ([recording.topics[name]] if name in recording.topics else [])
        if not cores:
            return recording.find(path.replace(mark, ""), where, plan.where)
        whole = _of_core_in_use(name + mark, cores, recording, status_of(name))
        recording.topics[name + mark] = whole
    return recording.find(path, where, plan.where)


def _of_core_in_use(name: str, cores: Sequence[Topic], recording: Recording, says: str) -> Topic:
    status = recording.instances(says) or ([recording.topics[says]] if says in recording.topics else [])
    status = [s for s in status if "PI" in s.columns]
    if not status or len(cores) == 1:
        return replace(cores[0], name=name)
    parts = []
    for core in cores:
        number = int(core.name[core.name.index("[") + 1 : -1]) if "[" in core.name else 0
        parts.append(_held(status[0], "PI", core) == number)
    if not any(p.any() for p in parts):
        return replace(cores[0], name=name)
    t = np.concatenate([c.t[p] for c, p in zip(cores, parts, strict=True)])
    order = np.argsort(t, kind="stable")
    columns = {
        n: np.concatenate([c.columns[n][p] for c, p in zip(cores, parts, strict=True)])[order]
        for n in cores[0].columns
        if all(n in c.columns for c in cores)
    }
    return Topic(name, cores[0].kind, t[order], columns)
