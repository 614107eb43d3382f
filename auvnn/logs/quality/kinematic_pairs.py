"""Two recordings of one motion: a velocity that was measured, beside the same from the positions or the attitude."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.run import Run
from auvnn.logs.signals.derivatives import LocalPolynomial, noise_gain
from auvnn.logs.signals.noise import noise_std
from auvnn.logs.signals.rotation import body_rates, conjugate, continuous, rotate

if TYPE_CHECKING:
    pass


Array = NDArray[np.float64]


_HALF_WINDOW = 0.4  # s; wide enough to quiet the derivative, narrow enough for a small vehicle's motion


@dataclass(frozen=True)
class Pair:
    """One run's derived and measured components after the same filter, (N, 3) each, and their noise (3,)."""

    number: int
    dt: float
    derived: Array
    measured: Array
    derived_noise: Array
    measured_noise: Array


def half_width(dt: float) -> int:
    """Return the filter's half width in samples for a time step: 0.4 s, at least 3 and at most 50."""
    return int(np.clip(round(_HALF_WINDOW / dt), 3, 50))


def rates(run: Run) -> Pair:
    """Return the body rates derived from the attitude and as measured, equally filtered, with their noise."""
    derived, measured = _rates(run, run.quaternion)
    gain, slope_gain = noise_gain(run.dt, half_width(run.dt))
    noise = np.asarray(noise_std(run.t, np.concatenate([continuous(run.quaternion), run.nu[:, 3:]], axis=1)))
    derived_noise = np.full(3, 2.0 * slope_gain * float(np.nanmax(np.append(noise[:4], 0.0))))
    return Pair(run.number, run.dt, derived, measured, derived_noise, gain * noise[4:])


def _rates(run: Run, quaternion: Array) -> tuple[Array, Array]:
    smoother = LocalPolynomial(run.t, half_width(run.dt))
    smooth, slope = smoother(np.concatenate([continuous(quaternion), run.nu[:, 3:]], axis=1))
    return body_rates(smooth[:, :4], slope[:, :4]), smooth[:, 4:]


def velocities(run: Run) -> Pair | None:
    """Return the body velocity derived from the position and as measured, equally filtered."""
    if run.position is None or np.isnan(run.position).all(axis=0).any():
        return None
    h = half_width(run.dt)
    signals = np.concatenate([continuous(run.quaternion), run.position, run.nu[:, :3]], axis=1)
    smooth, slope = LocalPolynomial(run.t, h)(signals)
    gain, slope_gain = noise_gain(run.dt, h)
    noise = np.asarray(noise_std(run.t, signals[:, 4:]))
    attitude = smooth[:, :4] / np.linalg.norm(smooth[:, :4], axis=1, keepdims=True)
    derived = rotate(conjugate(attitude), slope[:, 4:7])
    derived_noise = np.full(3, slope_gain * float(np.nanmax(np.append(noise[:3], 0.0))))
    return Pair(run.number, run.dt, derived, smooth[:, 7:], derived_noise, gain * noise[3:])
