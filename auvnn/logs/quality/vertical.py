"""Does the depth follow the vertical velocity? If not: a wrong unit of pressure, a sensor inside the hull, or a sign.

The derivative of z must be the world's downward component of the body velocity, (R nu)_z; it does not need x and y,
which many logs lack.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from auvnn.logs.quality.kinematic_pairs import half_width
from auvnn.logs.quality.kinematics import fit
from auvnn.logs.signals.derivatives import LocalPolynomial, noise_gain
from auvnn.logs.signals.noise import noise_std
from auvnn.logs.signals.rotation import rotate

if TYPE_CHECKING:
    from auvnn.logs.log import Log

_CLEAR, _NONE = 0.7, 0.4  # correlation
_WEAK = 0.3  # of the motion: a depth that follows by less is not that of the water around the vehicle
_TOLERANCE = 0.2
_MOVES = 3.0  # standard deviations of its noise
_SLOWEST = 0.02  # m/s: slower vertical motion says nothing
_SAMPLES = 100
_METRE = 1025.0 * 9.81 / 1e5  # bar per metre of sea water

# Slope of dz/dt on the vertical velocity, what it means, and the scale that corrects it.
_UNITS = (
    (0.01, "a pressure in hPa (mbar) was read as Pa", 100.0),
    (100.0, "a pressure in Pa was read as hPa, or a depth in cm", 0.01),
    (1e5 * _METRE, "a pressure in Pa", 1e-5 / _METRE),
    (1e2 * _METRE, "a pressure in kPa", 1e-2 / _METRE),
    (_METRE, "a pressure in bar", 1.0 / _METRE),
    (1000.0, "a depth in mm", 0.001),
)


@dataclass(frozen=True)
class Vertical:
    """How the depth follows the vertical velocity.

    Args:
        scale: slope of dz/dt on the vertical velocity, 1 where all is well; NaN where not testable.
        correlation: of the two.
        level: "info" where they agree or cannot be compared.
        verdict: plain words.
        cure: what to write into the mapping, or "".
    """

    scale: float
    correlation: float
    level: Literal["error", "warning", "info"]
    verdict: str
    cure: str = ""


def check_vertical(log: Log) -> Vertical | None:
    """Return how the depth follows the vertical velocity, None where the log has no depth or does not move in it."""
    rates, speeds = [], []
    for run in log.runs:
        if run.position is None or np.isfinite(run.position[:, 2]).sum() < _SAMPLES or run.samples < _SAMPLES:
            continue
        h = half_width(run.dt)
        down = rotate(run.quaternion, run.nu[:, :3])[:, 2]
        smooth, slope = LocalPolynomial(run.t, h)(np.stack([down, run.position[:, 2]], axis=1))
        gain, slope_gain = noise_gain(run.dt, h)
        noise = np.nan_to_num(np.asarray(noise_std(run.t, np.stack([down, run.position[:, 2]], axis=1))))
        spread = float(np.nanstd(smooth[:, 0])) if np.isfinite(smooth[:, 0]).any() else 0.0
        moved = float(np.nanstd(slope[:, 1])) if np.isfinite(slope[:, 1]).any() else 0.0
        # A depth whose noise hides the motion, in its own unit or in metres, is no evidence against it.
        if (
            spread > max(_MOVES * gain * noise[0], _SLOWEST)
            and max(spread, moved) > _MOVES * slope_gain * noise[1]
        ):
            rates.append(slope[:, 1])
            speeds.append(smooth[:, 0])
    if not rates:
        return None
    dz, down = np.concatenate(rates), np.concatenate(speeds)
    scale, correlation = fit(down, dz)
    if not np.isfinite(scale):
        # A depth that stands still has no slope to speak of, and that is the finding.
        constant = np.nanstd(dz) < 1e-9 * max(float(np.nanstd(down)), 1e-9)
        return _unrelated(0.0, 0.0) if constant else None
    if abs(correlation) >= _CLEAR:
        for factor, words, correct in _UNITS:
            if abs(abs(scale) / factor - 1.0) < _TOLERANCE:
                cure = f"correct with scale: {np.sign(scale) * correct:.6g} for z in the mapping"
                verdict = f"z changes {abs(scale):.4g} times as fast as the vertical velocity: {words}"
                return Vertical(scale, correlation, "error", verdict, cure)
        if scale < 0.0:
            cure = "frame: {world: ENU}, or scale: -1 for z in the mapping"
            verdict = f"z runs against the vertical velocity (scale {scale:.2f}): does it point up?"
            return Vertical(scale, correlation, "error", verdict, cure)
        if scale > _WEAK:
            return Vertical(scale, correlation, "info", f"z follows the vertical velocity: scale {scale:.2f}")
    if abs(correlation) < _NONE or abs(scale) < _WEAK:
        return _unrelated(scale, correlation)
    return Vertical(
        scale, correlation, "info", f"z follows the vertical velocity only loosely ({correlation:.2f})"
    )


def _unrelated(scale: float, correlation: float) -> Vertical:
    verdict = (
        f"z hardly follows the vertical velocity (correlation {correlation:.2f}, scale {scale:.2g}): "
        "a pressure sensor inside the hull, or a depth that is not this vehicle's?"
    )
    return Vertical(
        scale, correlation, "warning", verdict, "take z from the outer pressure sensor, or leave it out"
    )
