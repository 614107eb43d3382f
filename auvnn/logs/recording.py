"""A recording of many topics, each with its own times: what a bag, a flight log or a telemetry file holds."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.errors import InputError
from auvnn.logs.reading.repairs.repair import Repair

Array = NDArray[np.float64]
Wanted = Callable[[str, str], bool]
"""Says by a topic's name and message type whether its messages are to be read."""

PRIMARY = "primary"
_INSTANCE = re.compile(r"(.*)\[([^\[\]]+)\]")


@dataclass(frozen=True)
class Asked:
    """What a mapping asks of a recording: topics, and of each the fields, so that no others are kept.

    Args:
        paths: from which the mapping takes values.
        always: fields that are kept of every topic that has them.
    """

    paths: frozenset[str]
    always: frozenset[str] = frozenset()

    def __call__(self, name: str, kind: str) -> bool:
        """Say whether a topic is asked for."""
        names = {base_name(topic_of(p)) for p in self.paths}
        return (
            base_name(name) in names
            or name in names
            or any(p == name or p.startswith(name + ".") for p in self.paths)
        )

    def fields(self, name: str) -> frozenset[str] | None:
        """Return the fields of a topic that are asked for; None for all, where a path does not say which."""
        found = [p[len(name) + 1 :] for p in self.paths if p.startswith(name + ".")]
        return None if name in self.paths or not found else frozenset(found) | self.always


@dataclass
class Topic:
    """Messages of one kind under one name, as columns of numbers.

    Args:
        name: as the recording calls it: `/odom`, `ATT`, `BARO[1]` (instance 1).
        kind: message type, "" where the format has none.
        t: when each message was measured, s since the recording's epoch, (N,), in the order of the file.
        columns: by path within the message (`twist.twist.linear.x`), (N,) each.
        words: texts within the message that never change: names of frames, of joints.
        arrival: when each message was recorded, s since the epoch, (N,); None where the format knows one time only.
        count: messages in the file, where `t` holds some of them only.
    """

    name: str
    kind: str
    t: Array
    columns: dict[str, NDArray[Any]]
    words: dict[str, str] = field(default_factory=dict)
    arrival: Array | None = None
    count: int = 0

    @property
    def messages(self) -> int:
        """Number of messages in the file."""
        return self.count or len(self.t)

    @property
    def rate(self) -> float:
        """Messages per second, by the median step of their times; NaN of fewer than two."""
        steps = np.diff(self.t[np.isfinite(self.t)])
        steps = steps[steps > 0.0]
        return float(1.0 / np.median(steps)) if len(steps) else float("nan")


@dataclass
class Recording:
    """Topics by name, and what was noted while reading.

    Args:
        topics: by name.
        repairs: what was corrected or doubted.
        facts: what the file says about the vehicle beside its messages, such as parameters.
        parts: times, s, at which a further recording within the same file begins.
    """

    topics: dict[str, Topic]
    repairs: list[Repair] = field(default_factory=list)
    facts: dict[str, Any] = field(default_factory=dict)
    parts: tuple[float, ...] = ()

    def find(self, path: str, where: str, mapping: str) -> tuple[Topic, str]:
        """Return the topic and the name of its column to which a path of a mapping leads.

        `topic.column`; of a topic with one column its name alone; `BARO[1].Alt` for an instance, and without the
        brackets where there is one instance only.

        Args:
            path: as it stands in the mapping.
            where: of the file, for messages.
            mapping: its name, for messages.

        Raises:
            InputError: there is no such topic or column, or several instances of it.
        """
        topic, rest = self._topic(path, where, mapping)
        if not rest and len(topic.columns) == 1:
            rest = next(iter(topic.columns))
        if rest not in topic.columns:
            known = list(topic.columns)
            if rest in topic.words:
                raise InputError(
                    f"{where}: {mapping} takes numbers from '{path}', which is the word '{topic.words[rest]}'"
                )
            raise InputError(
                f"{where}: {mapping} takes a value from '{path}': {unknown_name(f'field of {topic.name}', rest, known)}"
            )
        return topic, rest

    def _topic(self, path: str, where: str, mapping: str) -> tuple[Topic, str]:
        if "" in self.topics and path in self.topics[""].columns:
            return self.topics[""], path
        for end in [len(path), *(m.start() for m in reversed(list(re.finditer(r"\.", path))))]:
            name, rest = path[:end], path[end + 1 :]
            if name in self.topics:
                return self.topics[name], rest
            instances = self.instances(name)
            if len(instances) == 1:
                return instances[0], rest
            if instances:
                shown = ", ".join(t.name for t in instances)
                raise InputError(f"{where}: '{name}' has several instances; say which in {mapping}: {shown}")
        raise InputError(
            f"{where}: {mapping} takes a value from '{path}', a topic that is not there: "
            f"{unknown_name('topic', path.split('.')[0], self.topics)}"
        )

    def instances(self, name: str) -> list[Topic]:
        """Return the topics `name[...]`."""
        found = ((t, _INSTANCE.fullmatch(n)) for n, t in self.topics.items())
        return [t for t, m in found if m and m[1] == name]


def topic_of(path: str) -> str:
    """Return the longest name that the topic of a path can have without looking: all before the first dot."""
    return path.split(".")[0]


def base_name(name: str) -> str:
    """Return a topic's name without its instance."""
    match = _INSTANCE.fullmatch(name)
    return match[1] if match else name
