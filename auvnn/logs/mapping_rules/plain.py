"""Arrays that are called as the canonical columns are, in groups of any kind."""

from __future__ import annotations

from collections.abc import Callable

from auvnn.logs.channels import ACCELERATION, EULER, POSITION, QUATERNION, VELOCITY, WRENCH, is_canonical
from auvnn.logs.mapping_rules.rule import Rule
from auvnn.logs.recording import Recording, Topic


def _named(*groups: tuple[str, ...]) -> Callable[[Recording, Topic], dict[str, object]]:
    def columns(_: Recording, topic: Topic) -> dict[str, object]:
        for group in groups:
            if all(n in topic.columns for n in group):
                return {n: n for n in group}
        return {}

    return columns


def _numbered(kind: str) -> Callable[[Recording, Topic], dict[str, object]]:
    def columns(_: Recording, topic: Topic) -> dict[str, object]:
        return {n: n for n in topic.columns if n.startswith(f"{kind}_") and is_canonical(n)}

    return columns


_KIND = "array"
RULES = [
    Rule("attitude", _KIND, _named(QUATERNION, EULER)),
    Rule("velocity", _KIND, _named(VELOCITY[:3])),
    Rule("rates", _KIND, _named(VELOCITY[3:])),
    Rule("acceleration", _KIND, _named(ACCELERATION)),
    Rule("position", _KIND, _named(POSITION)),
    Rule("depth", _KIND, _named(("z",))),
    Rule("commands", _KIND, _numbered("thruster"), 4),
    Rule("commands", _KIND, _named(WRENCH), 5),
    Rule("fins", _KIND, _numbered("fin")),
    Rule("altitude", _KIND, _named(("altitude",))),
    Rule("voltage", _KIND, _named(("voltage",))),
]
