"""IMC messages of LSTS vehicles: NED and FRD, SNAME's symbols, radians."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from auvnn.logs.mapping_rules.rule import Rule, triple
from auvnn.logs.recording import Recording, Topic

_STATE = "^EstimatedState$"


def _actuators(name: str, canonical: str) -> Callable[[Recording, Topic], dict[str, object]]:
    """Return the columns of all actuators of a message, ids from 0 or 1 on."""

    def columns(recording: Recording, topic: Topic) -> dict[str, object]:
        found = {int(m[1]): t for t in recording.topics if (m := re.fullmatch(rf"{name}\[(\d+)\]", t))}
        first = min(found, default=0)
        if topic.name != found.get(first) or sorted(found) != list(range(first, first + len(found))):
            return {}
        return {f"{canonical}_{k - first + 1}": {"from": f"@{t}.value"} for k, t in sorted(found.items())}

    return columns


def _altitude(_: Recording, topic: Topic) -> dict[str, object]:
    heights = topic.columns.get("alt", np.zeros(0))
    return {"altitude": "alt"} if (heights >= 0.0).any() else {}


RULES = [
    Rule("attitude", "imc", triple("phi theta psi", "phi theta psi"), 1, _STATE),
    Rule("velocity", "imc", triple("u v w", "u v w"), 1, _STATE,
         note="{topic}: u, v, w may be over ground or through the water, as the vehicle's navigation has it"),
    Rule("rates", "imc", triple("p q r", "p q r"), 1, _STATE),
    Rule("position", "imc", {**triple("x y", "x y"), "z": "depth"}, 1, _STATE),
    Rule("altitude", "imc", _altitude, 1, _STATE),
    Rule("commands", "imc", _actuators("SetThrusterActuation", "thruster"), 1, "^SetThrusterActuation"),
    Rule("fins", "imc", _actuators("SetServoPosition", "fin"), 1, "^SetServoPosition"),
    Rule("fins", "imc", _actuators("ServoPosition", "fin"), 2, "^ServoPosition"),
    Rule("voltage", "imc", {"voltage": "value"}, 2, "^Voltage"),
]  # fmt: skip
