"""Do the velocities agree with how attitude and position change? Signs, units and axes found from that alone.

The body rates must be the derivative of the attitude, omega = 2 q* dq/dt, and the body velocity the
derivative of the position turned into the body, R(q)^T dx/dt. Both sides go through the same local
polynomial; the slope of measured on derived then is 1 where the log is right, -1 where a sign is turned,
57.3 where a rate is in degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from auvnn.logs.channels import VELOCITY
from auvnn.logs.quality.kinematic_pairs import Array, Pair, _rates, rates, velocities
from auvnn.logs.run import Run
from auvnn.logs.signals import lags
from auvnn.logs.signals.lags import Lag
from auvnn.logs.signals.rotation import conjugate

if TYPE_CHECKING:
    from auvnn.logs.log import Log


_CLEAR = 0.7  # correlation from which the slope is believed
_NONE = 0.4  # correlation below which two moving signals have nothing to do with each other
_SCALE_TOLERANCE = 0.2
_UNIT = 0.1  # share by which a scale may miss a unit's beyond what noise takes of it
_SIGN = (0.6, 1.6)  # scales, apart from the sign, up to which a turned sign is the plain reading
_MOVES = 3.0  # standard deviations of its noise by which a channel must move to count
_SHARE = 0.2  # of the liveliest run's motion: quieter runs say nothing about signs
_MIN_SAMPLES = 30
_LONG = 60_000  # samples; of longer runs evenly spread blocks tell as much
_BLOCKS, _BLOCK = 12, 5_000
_LAG = 1.0  # s searched to either side
_OTHER_CLOCK = 60.0  # s searched where nothing agrees as it is stamped
_ANGULAR_UNITS = (
    (180.0 / np.pi, "degrees per second, or the angles were radians and read as degrees"),
    (np.pi / 180.0, "radians per second that were read as degrees, or the angles were degrees"),
)
_LINEAR_UNITS = ((1000.0, "mm/s"), (100.0, "cm/s"), (1.943844, "knots"), (3.28084, "feet per second"))


@dataclass(frozen=True)
class Agreement:
    """How one velocity component agrees with the derivative of attitude or position.

    Args:
        scale: slope of the measured on the derived component, 1 where all is well; NaN where not testable.
        correlation: of the two, over the runs that move.
        verdict: plain words.
        level: "info" where it agrees or cannot be told, else "warning" or "error".
        cure: what to write into the mapping, or "".
        lag: by how much the measured component is late, s.
        lag_interval: 95 % interval of that, s.
        drift: change of the lag per second, where it changes beyond doubt.
        runs: (number, scale, correlation, moves) of every run.
    """

    scale: float
    correlation: float
    verdict: str
    level: Literal["error", "warning", "info"] = "info"
    cure: str = ""
    lag: float = float("nan")
    lag_interval: tuple[float, float] = (float("nan"), float("nan"))
    drift: float = 0.0
    runs: tuple[tuple[int, float, float, bool], ...] = field(default=())

    def to_dict(self) -> dict[str, object]:
        """Return the entry of the quality answer."""
        runs = [{"run": n, "scale": s, "correlation": c, "moves": m} for n, s, c, m in self.runs]
        return {
            "scale": self.scale,
            "correlation": self.correlation,
            "lag_s": self.lag,
            "lag_interval_s": list(self.lag_interval),
            "lag_drift": self.drift,
            "verdict": self.verdict,
            "runs": runs,
        }


def check_kinematics(log: Log) -> dict[str, Agreement]:
    """Return the agreement of p, q, r with the attitude and, where there is a position, of u, v, w."""
    runs = [_short(run) for run in log.runs]
    result = _judge_all([rates(run) for run in runs], VELOCITY[3:], "attitude", _ANGULAR_UNITS)
    moved = [pair for run in runs if (pair := velocities(run)) is not None]
    if moved:
        result |= _judge_all(moved, VELOCITY[:3], "position", _LINEAR_UNITS)
    return result


def clocks(log: Log, agreement: dict[str, Agreement]) -> dict[tuple[str, ...], Lag]:
    """Return the sensors that agree with attitude and position only under another clock, by their channels.

    Looked for where none of a sensor's channels agrees as it is stamped.

    Args:
        log: the log.
        agreement: what `check` says.
    """
    found = {}
    runs = [run for run in log.runs if run.samples <= _LONG]
    for names, pair_of in ((VELOCITY[:3], velocities), (VELOCITY[3:], rates)):
        judged = [agreement[n] for n in names if n in agreement and np.isfinite(agreement[n].correlation)]
        if not judged or max(abs(a.correlation) for a in judged) >= _CLEAR:
            continue
        pairs = [pair for run in runs if (pair := pair_of(run)) is not None]
        if pairs:
            dt = float(np.median([p.dt for p in pairs]))
            lag = lags.other_clock([(p.derived, p.measured) for p in pairs], dt, _OTHER_CLOCK)
            if lag is not None:
                found[names] = lag
    return found


def attitude_order(log: Log) -> str | None:
    """Return which reading of the quaternion agrees with the rates where the given one does not.

    Returns:
        "xyzw" or "wxyz" where the four parts stand in another order, "inverse" where the quaternion turns
        world into body, None where the given reading is the best or nothing can be said.
    """
    readings = {"given": [0, 1, 2, 3], "xyzw": [3, 0, 1, 2], "wxyz": [1, 2, 3, 0], "inverse": [0, 1, 2, 3]}
    explained = {}
    runs = [_short(run) for run in log.runs]
    for name, index in readings.items():
        left = total = 0.0
        for run in runs:
            q = run.quaternion[:, index]
            derived, measured = _rates(run, conjugate(q) if name == "inverse" else q)
            good = np.isfinite(derived).all(axis=1) & np.isfinite(measured).all(axis=1)
            left += float(((measured - derived)[good] ** 2).sum())
            total += float((measured[good] ** 2).sum())
        explained[name] = 1.0 - left / total if total > 0.0 else 0.0
    best = max(explained, key=lambda name: explained[name])
    return best if best != "given" and explained[best] > 0.7 and explained["given"] < 0.3 else None


def _short(run: Run) -> Run:
    """Return the run, or of a long one evenly spread blocks, which remain blocks: gaps lie between them."""
    if run.samples <= _LONG:
        return run
    starts = np.linspace(0, run.samples - _BLOCK, _BLOCKS).astype(int)
    rows = (starts[:, None] + np.arange(_BLOCK)).ravel()
    position = None if run.position is None else run.position[rows]
    return Run(run.number, run.t[rows], run.quaternion[rows], run.nu[rows], position=position)


def _judge_all(
    pairs: list[Pair], names: tuple[str, ...], source: str, units: tuple[tuple[float, str], ...]
) -> dict[str, Agreement]:
    return {name: _judge(pairs, i, name, names, source, units) for i, name in enumerate(names)}


def _judge(
    pairs: list[Pair],
    axis: int,
    name: str,
    names: tuple[str, ...],
    source: str,
    units: tuple[tuple[float, str], ...],
) -> Agreement:
    liveliest = max((_spread(p.measured[:, axis]) for p in pairs), default=0.0)
    fits = [fit(p.derived[:, axis], p.measured[:, axis]) for p in pairs]
    moving = [_moves(p, axis, liveliest) for p in pairs]
    runs = tuple((p.number, s, c, m) for p, (s, c), m in zip(pairs, fits, moving, strict=True))
    chosen = [p for p, m in zip(pairs, moving, strict=True) if m]
    of = f"the derivative of the {source}"
    if not chosen:
        verdict = (
            f"{name} could not be compared with {of}: one of the two changes too little, or is too short"
        )
        return Agreement(np.nan, np.nan, verdict, runs=runs)
    x = np.concatenate([p.derived[:, axis] for p in chosen])
    y = np.concatenate([p.measured[:, axis] for p in chosen])
    scale, correlation = fit(x, y)
    late = _lag(chosen, axis) if abs(correlation) > _NONE else Lag(np.nan)
    signs = {np.sign(s) for (s, c), m in zip(fits, moving, strict=True) if m and abs(c) > _NONE}
    share = "all runs that move" if len(signs) <= 1 else "most of the motion"
    facts = {
        "scale": scale,
        "correlation": correlation,
        "lag": late.value,
        "lag_interval": (late.low, late.high),
        "drift": late.drift,
        "runs": runs,
    }
    if abs(correlation) >= _CLEAR:
        sign = " with the opposite sign" if scale < 0.0 else ""
        for factor, unit in units:
            if _may_be(factor, abs(scale), correlation):
                cure = f"correct with scale: {np.sign(scale) / factor:.6g} in the mapping"
                if source == "attitude":
                    turned = ("deg", "rad") if factor > 1.0 else ("rad", "deg")
                    cure = "correct with rates: {} (or angles: {}) in the mapping".format(*turned)
                verdict = f"{name} is {abs(scale):.3g} times {of}{sign}: in {unit}; {cure}"
                return Agreement(**facts, verdict=verdict, level="error", cure=cure)
        if scale < 0.0 and source == "position" and not _SIGN[0] < -scale < _SIGN[1]:
            cure = "check the sensor's place and mounting: away from the origin it may see the turn instead"
            verdict = f"{name} runs against {of} in {share}, {-scale:.2f} times as large; {cure}"
            return Agreement(**facts, verdict=verdict, level="warning", cure=cure)
        if scale < 0.0:
            cure = "correct with scale: -1 in the mapping"
            verdict = f"{name} has the opposite sign of {of} in {share}: scale {scale:.2f}; {cure}"
            return Agreement(**facts, verdict=verdict, level="error", cure=cure)
        if abs(scale - 1.0) <= _SCALE_TOLERANCE:
            return Agreement(**facts, verdict=f"{name} agrees with {of}: scale {scale:.2f}")
        cure = "check the unit and the sensor's scale"
        verdict = f"{name} follows {of}, but {scale:.2f} times as large; {cure}"
        return Agreement(**facts, verdict=verdict, level="warning", cure=cure)
    other = _other_axis(chosen, axis, y)
    if other is not None and 0.6 < abs(other[1]) < 1.6:
        j, slope = other
        cure = f"check which column holds {name} and which {names[j]}"
        verdict = f"{name} follows {of} that belongs to {names[j]} (scale {slope:.2f}): exchanged? {cure}"
        return Agreement(**facts, verdict=verdict, level="error", cure=cure)
    if other is not None:
        j, slope = other
        cure = "consider a sensor that is turned in its mounting"
        if source == "position":
            cure += " (velocity_misalignment)"
        verdict = f"{name} holds {slope:.2f} of {names[j]} and little of its own; {cure}"
        return Agreement(**facts, verdict=verdict, level="warning", cure=cure)
    if abs(correlation) < _NONE:
        cure = "check the column, its clock and the frame in which it is given"
        verdict = f"{name} moves, but not as {of} (correlation {correlation:.2f}); {cure}"
        return Agreement(**facts, verdict=verdict, level="warning", cure=cure)
    verdict = f"{name} follows {of} only loosely (correlation {correlation:.2f}, scale {scale:.2f})"
    return Agreement(**facts, verdict=verdict, level="warning" if scale < 0.0 else "info")


def _spread(y: Array) -> float:
    return float(np.nanstd(y)) if np.isfinite(y).any() else 0.0


def _moves(pair: Pair, axis: int, liveliest: float) -> bool:
    x, y = pair.derived[:, axis], pair.measured[:, axis]
    if (np.isfinite(x) & np.isfinite(y)).sum() < _MIN_SAMPLES or liveliest == 0.0:
        return False
    above = _spread(y) > max(_MOVES * np.nan_to_num(pair.measured_noise[axis]), 1e-6)
    derived_above = _spread(x) > max(_MOVES * np.nan_to_num(pair.derived_noise[axis]), 1e-6)
    return bool(above and derived_above and _spread(y) > _SHARE * liveliest)


def fit(x: Array, y: Array) -> tuple[float, float]:
    """Return slope and correlation of y on x with a constant, outliers weighed down (Huber)."""
    good = np.isfinite(x) & np.isfinite(y)
    if good.sum() < _MIN_SAMPLES:
        return np.nan, np.nan
    x, y = x[good], y[good]
    weight = np.ones(len(x))
    slope = correlation = np.nan
    for _ in range(3):
        dx, dy = x - np.average(x, weights=weight), y - np.average(y, weights=weight)
        xx, yy, xy = (weight * dx * dx).sum(), (weight * dy * dy).sum(), (weight * dx * dy).sum()
        if xx <= 0.0 or yy <= 0.0:
            return np.nan, np.nan
        slope, correlation = float(xy / xx), float(xy / np.sqrt(xx * yy))
        residual = np.abs(dy - slope * dx)
        spread = 1.4826 * float(np.median(residual))
        if spread <= 0.0:
            break
        weight = 1.0 / np.maximum(1.0, residual / (2.0 * spread))
    return slope, correlation


def _may_be(factor: float, scale: float, correlation: float) -> bool:
    """Whether a slope of measured on derived is that of a unit.

    Noise of the derived motion makes a slope smaller, and leaves of it at least the square of the correlation: that much
    where all noise is there. A slope that is well known and lies between two units is a sensor's scale.

    Args:
        factor: of the unit.
        scale: the slope's size.
        correlation: of the two.

    Reference: Fuller (1987), Measurement Error Models, section 1.1, for the attenuation.
    """
    near = abs(scale / factor - 1.0) < _SCALE_TOLERANCE
    return near and scale * (1.0 - _UNIT) < factor < scale / correlation**2 * (1.0 + _UNIT)


def _other_axis(pairs: list[Pair], axis: int, y: Array) -> tuple[int, float] | None:
    for j in range(3):
        if j != axis:
            slope, correlation = fit(np.concatenate([p.derived[:, j] for p in pairs]), y)
            if abs(correlation) > 0.8:
                return j, slope
    return None


def _lag(pairs: list[Pair], axis: int) -> Lag:
    """Return by how much the measured component is late: the shift of largest |correlation|."""
    dt = float(np.median([p.dt for p in pairs]))
    return lags.estimate([(p.derived[:, axis], p.measured[:, axis]) for p in pairs], dt, _LAG)
