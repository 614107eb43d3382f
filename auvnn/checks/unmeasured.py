"""What a log can say nothing about: degrees of freedom without a sensor, and effects that act on nothing it holds."""

from __future__ import annotations

from auvnn.effects import EFFECTS
from auvnn.logs import Log
from auvnn.logs.channels import EULER, POSITION, VELOCITY
from auvnn.metrics.unmeasured import assumed

_WORDS = dict(zip(VELOCITY, ("surge", "sway", "heave", "roll", "pitch", "yaw"), strict=True))
_MOVES = dict(zip(VELOCITY, (*POSITION, *EULER), strict=True))


def blind(log: Log) -> list[str]:
    """Return in a line each which degrees of freedom are not seen directly, and which effects not at all.

    Nothing where attitude and all velocities were measured.

    Args:
        log: as recorded, or completed.
    """
    absent = log.unmeasured
    if not absent:
        return []
    runs = [run.measured for run in log.runs]
    there = {name for run in runs for name in run.channels}
    there |= set() if "attitude" in absent else {*EULER}
    found = []
    dark = [_WORDS[n] for n in VELOCITY if n in absent and _MOVES[n] not in there]
    if dark:
        found.append(
            f"{', '.join(dark)} not seen directly: coefficients and effects there show only by what they do to "
            "what was measured"
        )
    lost = {}
    for name in EFFECTS.names():
        needs = [c for c in EFFECTS.get(name).channels if c not in there and c in {*POSITION, *EULER}]
        reports = [c for c in _reported(name) if c in there]
        if needs or (_reported(name) and not reports):
            lost[name] = needs
    if lost:
        found.append(f"nothing can be said of {', '.join(lost)}: they act on what was not measured")
    if not {"u", "v", "x", "y"} & there:
        found.append(
            "a steady horizontal current moves vehicle and water alike: without u, v, x, y it does not show"
        )
    return found


def words(log: Log, actuators: bool = False) -> list[str]:
    """Return what a check reports on quantities without a sensor: what is assumed, and what cannot be known.

    Args:
        log: as recorded.
        actuators: whether a check of the actuators was asked for.
    """
    found = [*assumed(log), *blind(log)]
    if actuators and log.unmeasured:
        found.append("the actuators are not checked: that takes attitude and u, v, w, p, q, r")
    return found


def _reported(name: str) -> tuple[str, ...]:
    """Return the channels of which alone a sensor's fault shows."""
    if name.startswith("velocity_"):
        return VELOCITY[:3]
    if name == "gyro_bias":
        return VELOCITY[3:]
    return ()


__all__ = ["blind", "words"]
