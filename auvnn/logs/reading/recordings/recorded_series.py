"""Time series of one topic of a recording: values at their own times, attitudes and frames set right."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.channels import EULER, POSITION, QUATERNION, VELOCITY
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.mapping_file import frames
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.recordings.rates import Series
from auvnn.logs.reading.recordings.recorded_values import _held, _primary
from auvnn.logs.reading.repairs import attitude
from auvnn.logs.reading.stacking import stacked
from auvnn.logs.recording import Recording, Topic, base_name
from auvnn.logs.signals import differences

if TYPE_CHECKING:
    pass


Array = NDArray[np.float64]


_FLIPS = {"v", "w", "q", "r", "dv", "dw", "dq", "dr", "tau_Y", "tau_Z", "tau_M", "tau_N"}


class _Times:
    """The times of a topic's messages by the mapping's rules."""

    def __init__(self, recording: Recording, plan: Mapping, where: str, result: Table) -> None:
        self.recording, self.plan, self.where, self.result = recording, plan, where, result
        self.known: dict[str, Array] = {}

    def of(self, topic: Topic) -> Array:
        if topic.name not in self.known:
            rule = self.plan.topics.get(topic.name) or self.plan.topics.get(base_name(topic.name))
            t = topic.t
            if rule is not None:
                if rule.stamps == "arrival" and topic.arrival is not None:
                    t = topic.arrival
                t = t + (rule.offset if isinstance(rule.offset, float) else 0.0) - rule.delay
            source = self.plan.columns.get("t")
            if source is not None and source.source is not None:
                own = f"{source.source}".rsplit(".", 1)[-1]
                if own in topic.columns:
                    t = self.plan.seconds(topic.columns[own], False)
            self.known[topic.name] = t
        return self.known[topic.name]


def _series(
    names: list[str],
    values: list[Array],
    topic: Topic,
    delay: float,
    plan: Mapping,
    times: _Times,
    where: str,
) -> list[Series]:
    """Return what a topic says about one group of columns, in FRD and NED."""
    rule = plan.topics.get(topic.name) or plan.topics.get(base_name(topic.name))
    body = (rule.body if rule else None) or plan.body
    world = (rule.world if rule else None) or plan.world
    t = times.of(topic) - delay if delay else times.of(topic)
    data = dict(zip(names, values, strict=True))
    values.clear()  # what the columns are turned into takes their place
    changed = [plan.columns[n].more for n in names]
    in_world = any(m.world for m in changed)
    if any(n in QUATERNION + EULER for n in names):
        data = _attitude(data, names, t, body, world, plan, where)
    elif world == "ENU" and (in_world or set(names) & set(POSITION)):
        data = _to_ned(data, VELOCITY[:3] if in_world else POSITION)
    elif body == "FLU" and not in_world:
        for name in _FLIPS & {*data}:
            data[name] = -data[name]  # one after the other: each takes the place of what it was
    if any(m.difference for m in changed):
        return [_difference(names, data, t, topic, plan)]
    if changed[0].over is not None:
        # A displacement ends at its stamp: its mean velocity belongs to the middle.
        other, field = _primary(times.recording, changed[0].over, plan, where)
        took = other.columns[field] if other is topic else _held(other, field, topic)
        t = t - 0.5 * np.nan_to_num(took.astype(np.float64) * changed[0].over_factor)
    event, held = topic.kind == "moos", tuple(data)
    columns = list(data.values())
    data.clear()
    return [Series(held, t, stacked(columns), topic.name, topic.arrival, event)]


def _difference(names: list[str], data: dict[str, Array], t: Array, topic: Topic, plan: Mapping) -> Series:
    order = np.argsort(t, kind="stable")
    order = order[np.concatenate([[True], np.diff(t[order]) > 0.0])] if len(order) else order
    stacked = np.stack([data[n] for n in names], axis=1)[order]
    middle, speed = differences.of_positions(t[order], stacked)
    return Series(tuple(names), middle, speed, topic.name)


def _attitude(
    data: dict[str, Array], names: list[str], t: Array, body: str, world: str, plan: Mapping, where: str
) -> dict[str, Array]:
    if names[0] in EULER:
        if set(names) != set(EULER):
            # A vehicle that knows its heading alone, or roll and pitch alone, is level in the others as far as known.
            data = {n: data.get(n, np.zeros(len(t))) for n in EULER}
        angles = np.stack([data[n] for n in EULER], axis=1)
        if body == "FLU" or world == "ENU":
            q = frames.quaternion_to_ned_frd(
                attitude.from_angles(angles, t, np.zeros(len(t)), where)[0], body, world
            )
        else:
            q = attitude.from_angles(angles, t, np.zeros(len(t)), where)[0]
    else:
        if set(names) != set(QUATERNION):
            raise InputError(
                f"{where}: {plan.where} gives {', '.join(names)} from one topic, not a whole quaternion"
            )
        order = ("qz", "qw", "qx", "qy") if plan.quaternion == "xyzw" else QUATERNION
        q = stacked([data.pop(n) for n in order])
        # Memory of another array is the recording's, which must stay as it is.
        q = frames.quaternion_to_ned_frd(q, body, world, own=q.base is None)
    return dict(zip(QUATERNION, q.T, strict=True))


def _to_ned(data: dict[str, Array], names: tuple[str, ...]) -> dict[str, Array]:
    """Return values along east, north, up as those along north, east, down."""
    north, east, down = names
    out = {}
    if east in data:
        out[north] = data[east]
    if north in data:
        out[east] = data[north]
    if down in data:
        out[down] = -data[down]
    return out
