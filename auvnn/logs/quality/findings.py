"""What a person should know about a log, in plain words: where, what, and how to correct it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from auvnn.logs.channels import POSITION, VELOCITY
from auvnn.logs.quality import excitation as exciting
from auvnn.logs.quality import sensor_findings as sensors
from auvnn.logs.quality.channel_quality import Channel, frozen
from auvnn.logs.quality.command_rate import between_samples
from auvnn.logs.quality.excitation import Excitation
from auvnn.logs.quality.finding import Finding
from auvnn.logs.quality.kinematics import Agreement
from auvnn.logs.quality.run_findings import by_run
from auvnn.logs.quality.vertical import Vertical
from auvnn.logs.reading.repairs.repair import Level
from auvnn.logs.signals.lags import Lag
from auvnn.logs.signals.rotation import rotate
from auvnn.logs.signals.segments import default_gap

if TYPE_CHECKING:
    from auvnn.logs.log import Log

_STATE = (*VELOCITY, *POSITION)
_NAMES: dict[str, str] = {
    **dict(zip(VELOCITY, ("surge", "sway", "heave", "roll", "pitch", "yaw"), strict=True))
}
_ORDER = {"error": 0, "warning": 1, "repair": 2, "info": 3}


def collect(
    log: Log,
    channels: dict[str, Channel],
    kinematics: dict[str, Agreement],
    excitation: dict[str, Excitation],
    order: str | None,
    clocks: dict[tuple[str, ...], Lag] | None = None,
    vertical: Vertical | None = None,
) -> list[Finding]:
    """Return all findings, errors first.

    Args:
        log: that is judged.
        channels: quality by channel.
        kinematics: agreement of velocities with positions and attitude, by channel.
        excitation: by degree of freedom.
        order: the quaternion's order where it looks like another one, else None.
        clocks: lags between groups of channels.
        vertical: how depth, altitude and w agree.
    """
    found = [
        *(Finding(r.level, r.where, f"{r.what} ({r.count})", r.cure) for r in log.repairs),
        *_time(log),
        *_frozen(log, channels),
        *_signals(log, channels),
        *_attitude(log, order),
        *sensors.agreement(kinematics, order, clocks or {}, vertical),
        *by_run(log, kinematics),
        *sensors.restarts(log),
        *sensors.levers(log, kinematics),
        *sensors.stretches(log),
        *_excitation(log, excitation),
        *between_samples(log),
    ]
    if log.unknown:
        found.append(Finding("info", "columns", f"kept but not used: {', '.join(log.unknown)}"))
    return sorted(found, key=lambda f: _ORDER[f.level])


def gaps(log: Log) -> dict[int, tuple[int, float, float]]:
    """Return by run the number of gaps, the longest step, s, and the jitter as a share of the median step."""
    result = {}
    for run in log.runs:
        steps = np.diff(run.t)
        limit = default_gap(run.t)
        inside = steps[steps <= limit]
        jitter = float(inside.std() / run.dt) if len(inside) else 0.0
        result[run.number] = (int((steps > limit).sum()), float(steps.max()), jitter)
    return result


def _time(log: Log) -> list[Finding]:
    found = []
    for number, (count, longest, jitter) in gaps(log).items():
        where = f"run {number}"
        if count:
            what = f"{count} gaps in time, the longest {longest:.3g} s; nothing is interpolated across them"
            found.append(Finding("warning", where, what))
        if jitter > 0.2:
            what = f"time steps vary by {100 * jitter:.0f} % of their median; the true stamps are used"
            found.append(Finding("warning", where, what))
    return found


def _frozen(log: Log, channels: dict[str, Channel]) -> list[Finding]:
    found = []
    for name in (n for n in _STATE if n in channels):
        if channels[name].constant:
            others = [n for n in _STATE if n in channels and not channels[n].constant]
            if others:
                what = f"never changes from {channels[name].low:.4g} while {', '.join(others)} do"
                found.append(
                    Finding("warning", name, what, "if it was not measured, say so; else repair the sensor")
                )
    candidates = [n for n in VELOCITY if channels[n].frozen_share > 0.0 and channels[n].noise_std > 0.0]
    for name in candidates:
        count = 0
        for run in log.runs:
            i = VELOCITY.index(name)
            others = [
                frozen(run, run.nu[:, j]) for j in range(6) if j != i and not channels[VELOCITY[j]].constant
            ]
            if others:
                # A vehicle at rest in a simulation stands still in all channels: no sensor is at fault.
                count += int((frozen(run, run.nu[:, i]) & ~np.logical_and.reduce(others)).sum())
        share = count / log.samples
        if share > 0.02 and not channels[name].constant:
            what = f"stands still for 1 s or longer while others move, {100 * share:.0f} % of the log"
            found.append(Finding("warning", name, what, "leave those stretches out, or mark them as missing"))
    held = {n: channels[n].repeated_share for n in _STATE if n in channels and not channels[n].constant}
    held = {n: s for n, s in held.items() if s > 0.05 and channels[n].noise_std > 0.0}
    if held:
        shares = ", ".join(f"{n} {100 * s:.0f} %" for n, s in held.items())
        what = f"consecutive samples are equal (sample and hold): {shares}; the sensor is slower than the log"
        found.append(
            Finding("warning", "sampling", what, "log each channel when it is measured, or resample")
        )
    return found


def _signals(log: Log, channels: dict[str, Channel]) -> list[Finding]:
    found = []
    missing = {n: c.missing_share for n, c in channels.items() if 0.0 < c.missing_share < 1.0}
    if missing:
        shares = ", ".join(f"{n} {100 * s:.2g} %" for n, s in missing.items())
        level: Level = "warning" if max(missing.values()) > 0.05 else "info"
        found.append(Finding(level, "missing", f"samples missing: {shares}; they are left out, not filled"))
    spikes = {n: c.spikes for n, c in channels.items() if c.spikes}
    if spikes:
        shares = ", ".join(f"{n} {k} ({100 * k / log.samples:.2g} %)" for n, k in spikes.items())
        what = f"single samples that leave their neighbours: {shares}; fits and scores leave them out"
        found.append(Finding("warning", "spikes", what))
    voltage = [run.voltage[np.isfinite(run.voltage)] for run in log.runs if run.voltage is not None]
    voltage = [v for v in voltage if len(v)]
    if voltage:
        high, low = (float(np.quantile(np.concatenate(voltage), q)) for q in (0.99, 0.01))
        if high > 0.0 and low < 0.85 * high:
            what = f"the battery falls from {high:.3g} to {low:.3g} V: thrust falls with it"
            found.append(Finding("warning", "voltage", what, "consider the effect voltage_droop"))
    depth = np.concatenate([[], *(run.position[:, 2] for run in log.runs if run.position is not None)])
    depth = depth[np.isfinite(depth)]
    if len(depth) and (middle := float(np.median(depth))) < -0.2:
        what = f"is {middle:.3g} m in the middle: above the surface if z points down"
        found.append(Finding("warning", "z", what, "frame: {world: ENU}, or scale: -1 for z in the mapping"))
    return found


def _attitude(log: Log, order: str | None) -> list[Finding]:
    found = []
    down = np.array([0.0, 0.0, 1.0])
    upright = np.concatenate([rotate(run.quaternion, down)[:, 2] for run in log.runs])
    upright = upright[np.isfinite(upright)]
    if len(upright) and float(np.median(upright)) < 0.0:
        what = "the vehicle is upside down most of the time"
        cure = "quaternion: xyzw, or frame: {body: ..., world: ...} in the mapping?"
        found.append(Finding("warning", "attitude", what, cure))
    cures = {
        "xyzw": ("the quaternion's parts stand in the order x, y, z, w", "quaternion: xyzw in the mapping"),
        "wxyz": ("the quaternion's parts stand in the order w, x, y, z", "quaternion: wxyz in the mapping"),
        "inverse": (
            "the quaternion turns world into body",
            "scale: -1 for qx, qy and qz in the mapping",
        ),
    }
    if order in cures:
        what, cure = cures[order]
        found.append(Finding("error", "attitude", f"{what}: only so does it agree with p, q, r", cure))
    return found


def _excitation(log: Log, excitation: dict[str, Excitation]) -> list[Finding]:
    found = []
    neutral, resting, saturated = exciting.commands(log)
    if neutral:
        kind = "thrusters are neutral" if log.kind == "thrusters" else "wrench is zero"
        what = f"the {kind} throughout: nothing about thrust, mass or damping can be told apart"
        cure = "check the command columns and their curve (neutral, span), or record a driven run"
        found.append(Finding("error", "excitation", what, cure))
    elif resting and log.kind == "thrusters":
        what = f"neutral throughout: {', '.join(resting)}; nothing can be said of their thrust"
        found.append(Finding("warning", "excitation", what))
    if saturated:
        what = f"at their limit most of the time: {', '.join(saturated)}; their gain is hard to tell"
        found.append(Finding("warning", "excitation", what, "drive with commands between the limits"))
    # Of a velocity without a sensor nothing is known, not even that it rests.
    absent = [n for n in VELOCITY if n in log.unmeasured]
    still = [n for n, e in excitation.items() if not e.excited and n not in absent]
    if absent and len(still) == len(VELOCITY) - len(absent):
        return found
    if len(still) == len(VELOCITY):
        what = "no velocity moves by more than three times its noise: there is nothing to fit"
        found.append(Finding("error", "excitation", what, "record a run in which the vehicle moves"))
    elif still:
        words = ", ".join(f"{_NAMES[n]} ({n})" for n in still)
        what = f"hardly excited: {words}; coefficients of these directions cannot be found"
        found.append(Finding("warning", "excitation", what, "record a run that moves in them"))
    return found
