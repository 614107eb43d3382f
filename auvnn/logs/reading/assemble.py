"""From a recording of many topics to one table under canonical names, by a mapping or by known messages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import ConfigError, InputError
from auvnn.logs.channels import ACCELERATION, EULER, POSITION, QUATERNION, VELOCITY, WRENCH
from auvnn.logs.known import lies, propose
from auvnn.logs.readers.base import Table
from auvnn.logs.reading import attitude, frames, other_clocks, rates
from auvnn.logs.reading.mapping import Column, Mapping
from auvnn.logs.reading.mapping_more import More
from auvnn.logs.reading.rates import Series
from auvnn.logs.reading.repair import Repair
from auvnn.logs.recording import PRIMARY, Recording, Topic, base_name, topic_of
from auvnn.logs.signals import differences

if TYPE_CHECKING:
    from auvnn.logs.readers.recordings import RecordingReader

Array = NDArray[np.float64]

_GROUPS = (QUATERNION, EULER, VELOCITY[:3], VELOCITY[3:], ACCELERATION, POSITION, WRENCH)
_BACK = 1.0  # s; a clock that goes back further was set
_FLIPS = {"v", "w", "q", "r", "dv", "dw", "dq", "dr", "tau_Y", "tau_Z", "tau_M", "tau_N"}


def assemble(reader: RecordingReader, path: Path, plan: Mapping, until: float | None = None) -> Table:
    """Return the canonical table of a recording.

    Args:
        reader: of its format.
        path: the file.
        plan: the mapping; one without columns asks what is known of the message types.
        until: s after the first stamp; later messages may be left out.

    Raises:
        InputError: the file is damaged; a topic is not there, or is known to lie about its frame; nothing in it is
            known and there is no mapping.
    """
    where = str(path)
    if plan.definitions is not None:
        from auvnn.logs.readers.ros_definitions import of_folder

        reader.extra_definitions = of_folder(Path(plan.definitions).expanduser())
    if not plan.columns:
        survey = reader.survey(path)
        if set(survey.topics) == {""}:
            return _flat(survey, plan, where)
        proposal = propose(survey)
        proposed = Mapping.read(proposal.mapping) if proposal.mapping.get("columns") else None
        if proposed is None:
            raise InputError(
                f"{where}: nothing in it is known to be what a log needs; `auvnn check log={path.name}` lists topics, "
                "and a mapping (mapping=) says which is which"
            )
        plan = replace(
            proposed, where="the known message types", heading=plan.heading, run=plan.run or proposed.run,
            topics=proposed.topics | plan.topics, commands=plan.commands if plan.commands.longest else proposed.commands,
        )  # fmt: skip
        notes = [Repair(words, where, 1, "info") for words in proposal.notes]
    else:
        notes = []
    names = {base_name(topic_of(p)) for p in sources(plan)}
    paths = set(sources(plan))

    def wanted(name: str, kind: str) -> bool:
        return (
            base_name(name) in names
            or name in names
            or any(p == name or p.startswith(name + ".") for p in paths)
        )

    recording = reader.record(path, wanted, until)
    if set(recording.topics) == {""} and not plan.topics:
        return _flat(recording, plan, where)
    table = from_recording(recording, plan, where, consume=True)
    table.repairs[:0] = [*recording.repairs, *notes]
    return table


def _flat(recording: Recording, plan: Mapping, where: str) -> Table:
    """Return the table of a file whose arrays all belong together, as that of a CSV file."""
    only = recording.topics[""]
    table = Table(dict(only.columns), len(only.t), repairs=list(recording.repairs))
    return plan.apply(table, where)


def sources(plan: Mapping) -> list[str]:
    """Return the paths of a recording that a mapping takes values from."""
    found: dict[str, None] = {}
    if plan.run not in (None, "file"):
        found[str(plan.run)] = None
    for column in plan.columns.values():
        each = [column.source, column.more.over, *column.cores, column.by]
        each += [c for c, _ in column.more.mix]
        each += [column.valid.source] if column.valid else []
        found.update((p, None) for p in each if p)
        if column.source and f"[{PRIMARY}]" in column.source:
            found.update((f"{base_name(topic_of(column.source))[:-1]}{n}.PI", None) for n in "4")
    return list(found)


def status_of(path: str) -> str:
    """Return the message that says which core of an ArduPilot estimator is in use: of EKF3 `XKF4`, of EKF2 `NKF4`."""
    return "NKF4" if path.startswith("NK") else "XKF4"


def from_recording(recording: Recording, plan: Mapping, where: str, consume: bool = False) -> Table:
    """Return the canonical table that a mapping makes of topics.

    Args:
        recording: with the topics that the mapping names.
        plan: the mapping.
        where: file, for messages.
        consume: whether the recording may be emptied, to spare memory.

    Raises:
        InputError: a topic or a field is not there, or lies about its frame.
        ConfigError: the mapping asks for something that cannot be done.
    """
    result = Table({}, 0)
    series: list[Series] = []
    constants: dict[str, float] = {}
    times = _Times(recording, plan, where, result)
    done: set[str] = set()
    for group in (*_GROUPS, *((n,) for n in plan.columns)):
        names = [n for n in group if n in plan.columns and n not in done and n != "t"]
        done |= set(names)
        for name in names:
            if plan.columns[name].source is None and not plan.columns[name].more.mix:
                constants[name] = plan.columns[name].value
        asked = [n for n in names if n not in constants]
        by_place: _Places = {}
        for name in asked:
            column = plan.columns[name]
            topic, values = _values(name, column, recording, plan, where, result)
            by_place.setdefault((topic.name, column.delay), []).append((name, topic, values))
        if group == EULER and len(by_place) > 1:
            by_place = _together(by_place, times)
        for (_, delay), found in by_place.items():
            series += _series(
                [n for n, _, _ in found], [v for _, _, v in found], found[0][1], delay, plan, times, where
            )
    if plan.run not in (None, "file"):
        numbers, field = recording.find(str(plan.run), where, plan.where)
        series.append(
            Series(
                ("run",),
                times.of(numbers),
                numbers.columns[field].astype(np.float64)[:, None],
                numbers.name,
                numbers.arrival,
            )
        )
    if plan.core is not None:
        words = "core: belongs to tables; of a recording take the instance, XKF1[primary].VN"
        raise ConfigError(f"{plan.where}: {words}")
    other_clocks.align(
        series, {n: r for n, r in plan.topics.items() if r.offset == "auto"}, where, result.repairs
    )
    if consume:
        recording.topics.clear()
        times.known.clear()
    _merged(series, recording, plan, where, result)
    for name, value in constants.items():
        result.columns[name] = np.full(result.rows, value)
    for group in (VELOCITY[:3], VELOCITY[3:], QUATERNION):
        if any(n in result.columns for n in group):
            for name in group:
                # A vehicle that knows its speed ahead alone says nothing of the others.
                result.columns.setdefault(name, np.full(result.rows, np.nan))
    world = tuple(n for n in VELOCITY[:3] if n in plan.columns and plan.columns[n].more.world)
    rest = {n: Column(n, more=More(world=True)) for n in world}
    result.rest = Mapping(
        columns=rest, heading=plan.heading, where=plan.where, run="file" if plan.run == "file" else None
    )
    result.seconds.add("t")
    return result


def _together(places: _Places, times: _Times) -> _Places:
    """Return angles of several topics as if they were of one, that with the most messages."""
    base = max(places, key=lambda p: len(places[p][0][1].t))
    topic = places[base][0][1]
    t = times.of(topic) - base[1]
    joined = list(places[base])
    for place, found in places.items():
        for name, other, values in found if place != base else ():
            own = times.of(other) - place[1]
            good = np.flatnonzero(np.isfinite(own) & np.isfinite(values))
            order = good[np.argsort(own[good], kind="stable")]
            if len(order):
                inside = np.interp(t, own[order], np.unwrap(values[order]), left=np.nan, right=np.nan)
                joined.append((name, topic, inside))
    return {base: joined}


_Places = dict[tuple[str, float], list[tuple[str, Topic, Array]]]
"""By topic and delay the columns, their topic and their values."""


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


def _values(
    name: str, column: Column, recording: Recording, plan: Mapping, where: str, result: Table
) -> tuple[Topic, Array]:
    """Return the topic of a column and its values in SI, in the topic's own frame."""
    if column.more.mix:
        found = [recording.find(p, where, plan.where) for p, _ in column.more.mix]
        topic = found[0][0]
        each = [t.columns[f] if t is topic else _held(t, f, topic) for t, f in found]
        return topic, plan.mixed(each, column, name, where, result)
    if column.by is not None:
        raise ConfigError(
            f"{plan.where}: columns: {name}: 'by' belongs to tables; of a recording take XKF1[primary].VN"
        )
    assert column.source is not None
    topic, field = _primary(recording, column.source, plan, where)
    words = lies(topic)
    rule = plan.topics.get(topic.name)
    if words and not (rule and rule.trust):
        raise InputError(f"{where}: '{topic.name}' is refused as a source of '{name}': {words}; if yours is right, say "
                         f"topics: {{{topic.name}: {{trust: true}}}} in the mapping")  # fmt: skip
    raw = topic.columns[field]
    if column.more.over is not None:
        other, over = _primary(recording, column.more.over, plan, where)
        raw = column.more.speed(raw, other.columns[over] if other is topic else _held(other, over, topic))
    values = plan.convert(raw, column, name, where, result)
    if column.valid is not None:
        other, judge = recording.find(column.valid.source, where, plan.where)
        judged = other.columns[judge] if other is topic else _held(other, judge, topic)
        table = Table({column.valid.source: judged}, len(topic.t))
        values, notes = column.valid.mask(values, table, name, where, plan.where)
        result.repairs += notes
    if column.more.factor is None:
        degrees = (
            plan.angles
            if name in EULER or name.startswith("fin_")
            else plan.rates
            if name in _TURNING
            else "rad"
        )
        values = values * (np.pi / 180.0) if degrees == "deg" else values
    return topic, np.asarray(values, dtype=np.float64)


_TURNING = (*VELOCITY[3:], *ACCELERATION[3:])


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


def _series(
    names: list[str],
    values: list[Array],
    topic: Topic,
    delay: float,
    plan: Mapping,
    times: _Times,
    where: str,
) -> list[Series]:
    """Return what a topic says of one group of columns, in FRD and NED."""
    rule = plan.topics.get(topic.name) or plan.topics.get(base_name(topic.name))
    body = (rule.body if rule else None) or plan.body
    world = (rule.world if rule else None) or plan.world
    t = times.of(topic) - delay
    data = dict(zip(names, values, strict=True))
    changed = [plan.columns[n].more for n in names]
    in_world = any(m.world for m in changed)
    if any(n in QUATERNION + EULER for n in names):
        data = _attitude(data, names, t, body, world, plan, where)
    elif world == "ENU" and (in_world or set(names) & set(POSITION)):
        data = _to_ned(data, VELOCITY[:3] if in_world else POSITION)
    elif body == "FLU" and not in_world:
        data = {n: -v if n in _FLIPS else v for n, v in data.items()}
    if any(m.difference for m in changed):
        return [_difference(names, data, t, topic, plan)]
    if changed[0].over is not None:
        # A displacement ends at its stamp: its mean velocity belongs to the middle.
        other, field = _primary(times.recording, changed[0].over, plan, where)
        took = other.columns[field] if other is topic else _held(other, field, topic)
        t = t - 0.5 * np.nan_to_num(took.astype(np.float64) * changed[0].over_factor)
    stacked = np.stack(list(data.values()), axis=1)
    event = topic.kind == "moos"
    return [Series(tuple(data), t, stacked, topic.name, topic.arrival, event)]


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
        parts = [data[n] for n in QUATERNION]
        if plan.quaternion == "xyzw":
            parts = [parts[3], *parts[:3]]
        q = np.stack(parts, axis=1)
        q = frames.quaternion_to_ned_frd(q, body, world)
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


def _merged(series: list[Series], recording: Recording, plan: Mapping, where: str, result: Table) -> None:
    """Merge the series part by part, a part being what lies between two restarts of the clock."""
    rows = rates.rows_of(series, plan.rows, where)
    pieces: list[dict[str, Array]] = []
    for number, part in enumerate(_parts(series, rows, recording.parts, where, result)):
        mine = rates.rows_of(part, plan.rows, where) if any(len(s.t) for s in part) else None
        if mine is None or len(mine.t) < 2:
            continue
        columns, notes = rates.merge(part, mine, where, plan.commands.between, plan.commands.longest)
        columns.setdefault("run", np.full(len(columns["t"]), float(number + 1)))
        pieces.append(columns)
        result.repairs += [n for n in notes if n.what not in {r.what for r in result.repairs}]
    if not pieces:
        raise InputError(f"{where}: the topics of the mapping hold no two samples with a time")
    names = list(dict.fromkeys(n for p in pieces for n in p))
    for name in names:
        if name == "run" and len(pieces) == 1 and plan.run is None:
            continue
        parts = [p.get(name, np.full(len(p["t"]), np.nan)) for p in pieces]
        result.columns[name] = np.concatenate(parts)
    result.rows = len(result.columns["t"])
    steps = {s.topic: s.step for s in series if len(s.t) > 1}
    if len(steps) > 1:
        told = ", ".join(f"{n} {1 / s:.3g} Hz" for n, s in steps.items() if np.isfinite(s))
        words = f"sensors of several rates brought to the times of {rows.topic}: {told}"
        result.repairs.append(Repair(words, where, len(steps), "info"))


def _parts(
    series: list[Series], rows: Series, cuts: tuple[float, ...], where: str, result: Table
) -> list[list[Series]]:
    back = np.flatnonzero(np.diff(rows.t) < -_BACK) + 1 if len(rows.t) > 1 else np.zeros(0, int)
    if not len(back) and not cuts:
        return [series]
    if len(back):
        words = "times at which the clock was set back: split there into further runs"
        result.repairs.append(Repair(words, where, len(back), "warning"))
    parts: list[list[Series]] = [[] for _ in range(len(back) + len(cuts) + 1)]
    for one in series:
        if (
            len(back)
            and rows.arrival is not None
            and one.arrival is not None
            and len(one.arrival) == len(one.t)
        ):
            index = np.searchsorted(rows.arrival[back], one.arrival, side="right")
        elif len(back):
            own = (
                np.cumsum(np.concatenate([[0], np.diff(one.t) < -_BACK])) if len(one.t) else np.zeros(0, int)
            )
            index = np.minimum(own, len(back))
        else:
            index = np.searchsorted(np.array(cuts), one.t, side="right")
        for k in range(len(parts)):
            parts[k].append(one.cut(index == k))
    return parts
