"""What the sensors say about one another and of the vehicle's situation, in plain words."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from auvnn.logs.channels import VELOCITY
from auvnn.logs.quality import lever, situations
from auvnn.logs.quality.finding import Finding
from auvnn.logs.quality.kinematics import Agreement
from auvnn.logs.quality.vertical import Vertical
from auvnn.logs.reading.repairs import resets
from auvnn.logs.signals import lags
from auvnn.logs.signals.lags import Lag

if TYPE_CHECKING:
    from auvnn.logs.log import Log

_LATE = 0.05  # s: less than that no log of this kind is stamped by


def agreement(
    kinematics: dict[str, Agreement],
    order: str | None,
    clocks: dict[tuple[str, ...], Lag],
    vertical: Vertical | None,
) -> list[Finding]:
    """Return where velocities, attitude, position and depth contradict one another, in size, sign or time.

    Args:
        kinematics: agreement of velocities with positions and attitude, by channel.
        order: the quaternion's order where it looks like another one, else None.
        clocks: lags between groups of channels.
        vertical: how depth, altitude and w agree.
    """
    found = []
    elsewhen = {name for names in clocks for name in names}
    of_depth = vertical is not None and vertical.level != "info"
    for name, judged in kinematics.items():
        # A quaternion in the wrong order, or another clock, explains the disagreement; one cause, one finding.
        if judged.level == "info" or order is not None or name in elsewhen:
            continue
        if name == "w" and of_depth and not _turned(judged):
            continue
        found.append(Finding(judged.level, name, judged.verdict, judged.cure))
    w = kinematics.get("w")
    if vertical is not None and of_depth and order is None and "w" not in elsewhen and not (w and _turned(w)):
        found.append(Finding(vertical.level, "z", vertical.verdict, vertical.cure))
    for names, lag in clocks.items():
        what = (
            f"{', '.join(names)} are stamped by another clock than attitude and position: {lag.value:+.2f} s "
            f"{_interval(lag)}, correlation {lag.correlation:.2f} there (+ is late)"
        )
        cure = f"give them the delay in the mapping, {names[0]}: {{delay: {lag.value:.3g}}}"
        found.append(Finding("warning", "clock", what, cure))
    return [*found, *_late(kinematics)]


def _turned(agreement: Agreement) -> bool:
    """Say whether a component's sign or axis is at fault, which the depth cannot explain."""
    return "opposite sign" in agreement.verdict or "exchanged" in agreement.verdict


def _late(kinematics: dict[str, Agreement]) -> list[Finding]:
    known = {
        name: Lag(a.lag, *a.lag_interval, a.correlation, a.drift)
        for name, a in kinematics.items()
        if abs(a.correlation) > 0.7
    }
    late = {n: lag for n, lag in known.items() if _is_late(lag)}
    found = []
    if late:
        times = ", ".join(f"{n} {lag.value:+.2f} s {_interval(lag)}".rstrip() for n, lag in late.items())
        what = f"velocities are not at the time of attitude and position (+ is late): {times}"
        sensor = [lag for n, lag in late.items() if n in VELOCITY[:3]]
        if len(sensor) > 1:
            common = lags.together(sensor)
            if common.high - common.low < 0.5 * abs(common.value):
                what += f"; of the velocity sensor {common.value:+.2f} s {_interval(common)}"
        worst = max(late, key=lambda n: abs(late[n].value))
        cure = (
            "correct the stamps, or give the late columns a delay in the mapping, "
            f"{worst}: {{delay: {late[worst].value:.2g}}}"
        )
        found.append(Finding("warning", "delay", what, cure))
    drifting = {n: lag for n, lag in known.items() if lag.drift}
    if drifting:
        rates = ", ".join(f"{n} {60e3 * lag.drift:+.0f} ms a minute" for n, lag in drifting.items())
        what = f"the clock of some channels drifts against attitude and position: {rates}"
        found.append(Finding("warning", "clock", what, "stamp all channels by one clock"))
    return found


def _is_late(lag: Lag) -> bool:
    """Say whether a lag is worth a word: beyond a step or two, and beyond three standard errors where those are known.

    Six channels are judged at once in every log, so that two standard errors would be passed by one good log in four.
    """
    return abs(lag.value) > _LATE and not abs(lag.value) < 3.0 * lag.std


def _interval(lag: Lag) -> str:
    return f"({lag.low:.2f} to {lag.high:.2f})" if np.isfinite(lag.low) else ""


def restarts(log: Log) -> list[Finding]:
    """Return where the pose starts again."""
    found = []
    for run in log.runs:
        if not len(run.restarts):
            continue
        of_column = len(resets.counted(run))
        jumps = len(run.restarts) - len(np.intersect1d(run.restarts, resets.counted(run)))
        causes = [f"{of_column} by the column reset"] if of_column else []
        causes += [f"{jumps} by a jump against the velocities that stays"] if jumps else []
        often = "once" if len(run.restarts) == 1 else f"{len(run.restarts)} times"
        what = (
            f"the pose starts again {often} ({', '.join(causes)}; first at "
            f"{run.t[run.restarts[0]]:.6g} s): cut into segments there, nothing reaches across"
        )
        found.append(Finding("repair", f"run {run.number}", what))
    return found


def levers(log: Log, kinematics: dict[str, Agreement]) -> list[Finding]:
    """Return sensors that sit away from the body origin, or whose place nobody can tell."""
    # Where signs, units or axes are wrong, what is left over is no lever arm.
    if any(a.level == "error" for a in kinematics.values()):
        return []
    found = []
    for place in lever.check_lever_arms(log):
        if place.clear:
            sensor = "velocity sensor" if place.sensor == "velocity" else "accelerometer"
            what = f"the {sensor} seems to sit away from the body origin: {place.words} (95 % intervals)"
            cure = "carry its readings over to the origin, or consider the effect velocity_lever_arm"
            if place.sensor == "acceleration":
                cure = "carry the accelerations over to the origin, or leave du ... dr out"
            found.append(Finding("warning", "lever arm", what, cure))
    if lever.cannot_tell(log):
        what = "the vehicle turns, and without a position nobody can tell whether the velocities are those of its origin"
        cure = "if the sensor's place is uncertain, consider the effect velocity_lever_arm"
        found.append(Finding("info", "lever arm", what, cure))
    return found


def stretches(log: Log) -> list[Finding]:
    """Return the stretches in which the vehicle was no free body under water, and drift without a command."""
    found = []
    all_of_them = situations.find(log)
    for kind, words in situations.WORDS.items():
        some = [s for s in all_of_them if s.kind == kind]
        if some:
            cure = "leave those stretches out before fitting"
            found.append(Finding("warning", "situation", f"{_when(some)} {words}", cure))
    drifting = [s for s in all_of_them if s.kind == "drifting"]
    if drifting:
        speed = float(np.median([s.value for s in drifting]))
        what = (
            f"{_when(drifting)} the vehicle goes on at about {speed:.2f} m/s over ground without any command: a current? "
            "The velocities are over ground, and nothing says what the water does"
        )
        found.append(Finding("warning", "current", what, "consider the effect ocean_current"))
    return found


def _when(some: list[situations.Stretch]) -> str:
    """Return the stretches in words, the longest first."""
    ordered = sorted(some, key=lambda s: s.start - s.stop)
    parts = [f"run {s.run} from {s.start:.4g} to {s.stop:.4g} s" for s in ordered[:3]]
    total = sum(s.stop - s.start for s in some)
    more = f" and {len(some) - 3} more, {total:.3g} s in all" if len(some) > 3 else ""
    return f"{', '.join(parts)}{more}:"
