"""A rule: fields of one message type and the canonical columns that they are."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auvnn.logs.recording import Recording, Topic

Columns = Mapping[str, Any]
BLOCKS = (
    "attitude",
    "velocity",
    "rates",
    "position",
    "depth",
    "commands",
    "fins",
    "altitude",
    "voltage",
    "ballast",
    "acceleration",
)


@dataclass(frozen=True)
class Rule:
    """What a message type is good for.

    Args:
        block: what it gives, one of `BLOCKS`.
        kind: pattern of the message type.
        columns: canonical name to field, or to what a mapping says about it with `from` relative to the topic; or a
            function of recording and topic that returns this.
        rank: smaller goes first where several topics give the same.
        name: pattern that the topic's name must contain.
        when: fields of the message that must have a value throughout.
        frame: what `topics:` of a mapping says about it.
        note: what a user should know.
    """

    block: str
    kind: str
    columns: Columns | Callable[[Recording, Topic], Columns]
    rank: int = 5
    name: str = ""
    when: Mapping[str, float] = field(default_factory=dict)
    frame: Mapping[str, Any] | Callable[[Topic], Mapping[str, Any]] = field(default_factory=dict)
    note: str = ""

    def of(self, recording: Recording, topic: Topic) -> dict[str, Any]:
        """Return the columns that a topic gives by this rule, {} where it does not fit."""
        if not re.fullmatch(self.kind, topic.kind) or (self.name and not re.search(self.name, topic.name)):
            return {}
        for name, value in self.when.items():
            column = topic.columns.get(name)
            if column is None or not (column == value).any():
                return {}
        found = self.columns(recording, topic) if callable(self.columns) else self.columns
        out = {}
        for canonical, spec in found.items():
            full = absolute(spec, topic.name)
            inside = [spec] if isinstance(spec, str) else [spec.get("from")]
            if not all(n is None or _has(topic, n) for n in inside):
                return {}
            out[canonical] = full
        return out

    def framed(self, topic: Topic) -> dict[str, Any]:
        """Return what the mapping says about the topic's frame."""
        return dict(self.frame(topic) if callable(self.frame) else self.frame)


@dataclass(frozen=True)
class Lie:
    """A kind of topic that is known to say something else than its frame claims.

    Args:
        kind: pattern of the message type.
        name: pattern that the topic's name must contain.
        words: what it says instead, and what to use.
    """

    kind: str
    name: str
    words: str

    def meets(self, topic: Topic) -> bool:
        """Say whether this is such a topic."""
        return bool(re.fullmatch(self.kind, topic.kind) and re.search(self.name, topic.name))


def _has(topic: Topic, name: str) -> bool:
    if name.startswith("@"):
        return True
    column = topic.columns.get(name)
    return column is not None and (column.dtype.kind in "iub" or bool(np.isfinite(column).any()))


def absolute(spec: Any, topic: str) -> Any:
    """Return what a mapping says about a column with its sources below a topic."""
    if isinstance(spec, str):
        return f"{topic}.{spec}" if topic else spec
    out = dict(spec)
    if "from" in out:
        # A path that begins with @ is that of another topic.
        out["from"] = out["from"][1:] if out["from"].startswith("@") else f"{topic}.{out['from']}"
    for key in ("over", "valid"):
        if key in out:
            out[key] = {**out[key], "from": f"{topic}.{out[key]['from']}"}
    return out


def triple(names: str, fields: str, **more: Any) -> dict[str, Any]:
    """Return specifications of several columns that differ in their field alone: `triple("u v w", "VN VE VD")`.

    Args:
        names: canonical names, apart by spaces.
        fields: fields of the topic, as many, apart by spaces.
        **more: further options that all of them have, as in a mapping file.
    """
    pairs = zip(names.split(), fields.split(), strict=True)
    return {n: {"from": f, **more} if more else f for n, f in pairs}


PWM = {"neutral": 1500, "span": 400}


def pwm_channels(topic: Topic, pattern: str, recording: Recording, base: int = 0) -> dict[str, Any]:
    """Return thruster columns of a topic's pulse widths: those that the parameters call motors, else those in use.

    The field of channel 1 is `pattern.format(1 - base)`. ArduPilot's functions 33 to 40 are motors 1 to 8, and
    `MOT_n_DIRECTION` -1 turns the output of a motor round.

    Args:
        topic: with the pulse widths.
        pattern: of the names of its fields, with one place for a number.
        recording: for the autopilot's parameters.
        base: 1 where the fields count from zero.
    """
    parameters = recording.facts.get("parameters", {})
    motors: dict[int, int] = {}
    for name, value in parameters.items():
        match = re.fullmatch(r"SERVO(\d+)_FUNCTION", name)
        if match and 33 <= value <= 40:
            motors[int(value) - 32] = int(match[1])
    if motors and set(motors) == set(range(1, len(motors) + 1)):
        channels = [(motors[k], parameters.get(f"MOT_{k}_DIRECTION", 1.0)) for k in sorted(motors)]
    else:
        channels = []
        for number in range(1, 9):
            column = topic.columns.get(pattern.format(number - base))
            values = (
                np.zeros(0)
                if column is None
                else column[np.isfinite(column) & (column > 0) & (column < 65535)]
            )
            if len(values) == 0 or values.min() < 800 or values.max() > 2200:
                break
            channels.append((number, 1.0))
    out: dict[str, Any] = {}
    for k, (number, sign) in enumerate(channels):
        if pattern.format(number - base) not in topic.columns:
            return {}
        spec: dict[str, Any] = {"from": pattern.format(number - base), "curve": dict(PWM)}
        if sign < 0:
            spec["scale"] = -1
        out[f"thruster_{k + 1}"] = spec
    return out


def numbered_columns(topic: Topic, pattern: str, canonical: str, **more: Any) -> dict[str, Any]:
    """Return columns 1, 2, ... of fields `pattern.format(0)`, `pattern.format(1)`, ... as far as they hold numbers.

    Args:
        topic: with the fields.
        pattern: of their names, with one place for a number from 0.
        canonical: what the columns are called, before `_1`, `_2`, ...
        **more: further options that all of them have, as in a mapping file.
    """
    out: dict[str, Any] = {}
    for i in range(64):
        if not _has(topic, pattern.format(i)):
            break
        out[f"{canonical}_{i + 1}"] = {"from": pattern.format(i), **more} if more else pattern.format(i)
    return out
