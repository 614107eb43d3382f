"""From a recording of many topics to one table under canonical names, by a mapping or by known messages."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from auvnn.errors import ConfigError, InputError
from auvnn.logs.channels import ACCELERATION, EULER, POSITION, QUATERNION, VELOCITY, WRENCH
from auvnn.logs.mapping_rules import lies, propose
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.mapping_file.columns import Column
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.mapping_file.mapping_more import More
from auvnn.logs.reading.recordings import other_clocks
from auvnn.logs.reading.recordings.asked_for import Spare, alike, asked_of, joined, lacking
from auvnn.logs.reading.recordings.rates import Series
from auvnn.logs.reading.recordings.recorded_series import Array, _series, _Times
from auvnn.logs.reading.recordings.recorded_values import _held, _primary
from auvnn.logs.reading.recordings.stretches import _merged
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording, Topic

if TYPE_CHECKING:
    from auvnn.logs.readers.recordings import RecordingReader


_GROUPS = (QUATERNION, EULER, VELOCITY[:3], VELOCITY[3:], ACCELERATION, POSITION, WRENCH)


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
    asked = asked_of(plan)
    recording = reader.record(path, asked, until)
    if set(recording.topics) == {""} and not plan.topics:
        return _flat(recording, plan, where)
    if lacking(recording, asked):
        # The message about a field that is not there offers those that are: all of them are read for it.
        recording = reader.record(path, lambda name, kind: asked(name, kind), until)
    table = from_recording(recording, plan, where, consume=True)
    table.repairs[:0] = [*recording.repairs, *notes]
    return table


def _flat(recording: Recording, plan: Mapping, where: str) -> Table:
    """Return the table of a file whose arrays all belong together, as that of a CSV file."""
    only = recording.topics[""]
    table = Table(dict(only.columns), len(only.t), repairs=list(recording.repairs))
    return plan.apply(table, where)


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
    spare = Spare(recording, plan) if consume else None
    done: set[str] = set()
    for group in (*_GROUPS, *(alike(n, plan) for n in plan.columns)):
        names = [n for n in group if n in plan.columns and n not in done and n != "t"]
        done |= set(names)
        for name in names:
            if plan.columns[name].source is None and not plan.columns[name].more.mix:
                constants[name] = plan.columns[name].value
        asked = [n for n in names if n not in constants]
        series += _of_group(group, asked, recording, plan, times, where, result, spare)
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
        for one in recording.topics.values():
            one.columns.clear()  # a topic may be held elsewhere: its columns are what is large
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


def _of_group(
    group: tuple[str, ...],
    names: list[str],
    recording: Recording,
    plan: Mapping,
    times: _Times,
    where: str,
    result: Table,
    spare: Spare | None,
) -> list[Series]:
    """Return what the topics say of some columns that belong together."""
    by_place: _Places = {}
    for name in names:
        column = plan.columns[name]
        topic, values = _values(name, column, recording, plan, where, result)
        by_place.setdefault((topic.name, column.delay), []).append((name, topic, values))
        if spare is not None:
            spare.drop(column.source)
    if group == EULER and len(by_place) > 1:
        by_place = _together(by_place, times)
    out: list[Series] = []
    while by_place:
        place = next(iter(by_place))
        for some in joined(by_place.pop(place)):
            names, topic, values = [n for n, _, _ in some], some[0][1], [v for _, _, v in some]
            some.clear()
            out += _series(names, values, topic, place[1], plan, times, where)
    return out


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
