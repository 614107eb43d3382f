"""MOOS variables: x east, y north, heading in degrees clockwise from north; yaw, pitch and roll in radians.

A MOOS body has y forward, x to starboard and z up; NAV_PITCH is positive nose up as in NED, as is NAV_ROLL to starboard.
"""

from __future__ import annotations

from collections.abc import Callable

from auvnn.logs.mapping_rules.rule import Rule
from auvnn.logs.recording import Recording, Topic


def present(*names: tuple[str, str, dict[str, object]]) -> Callable[[Recording, Topic], dict[str, object]]:
    """Return a rule's columns where each variable is a separate topic: those there are, if the first is."""

    def columns(recording: Recording, topic: Topic) -> dict[str, object]:
        found: dict[str, object] = {
            c: {"from": f"@{v}", **more} for c, v, more in names if v in recording.topics
        }
        return found if names[0][1] == topic.name else {}

    return columns


_DEG: dict[str, object] = {"unit": "deg"}
RULES = [
    Rule("attitude", "moos", present(("psi", "NAV_HEADING", _DEG), ("phi", "NAV_ROLL", {}), ("theta", "NAV_PITCH", {}))),
    Rule("velocity", "moos", present(("u", "NAV_SPEED", {})),
         note="NAV_SPEED is taken as u; v and w are not measured"),
    Rule("position", "moos", present(("x", "NAV_Y", {}), ("y", "NAV_X", {}), ("z", "NAV_DEPTH", {}))),
    Rule("altitude", "moos", present(("altitude", "NAV_ALTITUDE", {}))),
    Rule("commands", "moos", present(("thruster_1", "DESIRED_THRUST", {"scale": 0.01})),
         note="DESIRED_THRUST is taken as percent of the one thruster"),
    Rule("fins", "moos", present(("fin_1", "DESIRED_RUDDER", _DEG), ("fin_2", "DESIRED_ELEVATOR", _DEG)),
         note="DESIRED_RUDDER is taken as fin_1, DESIRED_ELEVATOR as fin_2"),
    Rule("voltage", "moos", present(("voltage", "BATTERY_VOLTAGE", {}))),
]  # fmt: skip
