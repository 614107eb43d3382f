"""How much a log moves in each degree of freedom, and whether that is enough to tell coefficients apart."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.channels import DRIVES, VELOCITY

if TYPE_CHECKING:
    from auvnn.logs.log import Log

Array = NDArray[np.float64]

EXCITED = 3.0  # standard deviations of its noise, as in the scores of a comparison
_STILL = 1e-3  # m/s or rad/s: below it a noise-free channel counts as still
_NEUTRAL = 0.02  # of full command
_MOVING = 0.1  # of the channel's 99th percentile


@dataclass(frozen=True)
class Excitation:
    """What one velocity component did.

    Args:
        std: standard deviation, m/s or rad/s.
        noise_std: white noise, same unit.
        low: smallest value.
        high: largest value.
        moving_share: share of the samples away from rest.
        condition: condition number of [nu_i, |nu_i| nu_i] with columns of unit length: how hard it is to
            tell linear from quadratic damping; infinite for a component that does not move.
    """

    std: float
    noise_std: float
    low: float
    high: float
    moving_share: float
    condition: float

    @property
    def excited(self) -> bool:
        """Whether the component moves by more than three times its noise."""
        return bool(self.std > max(EXCITED * np.nan_to_num(self.noise_std), _STILL))

    def to_dict(self) -> dict[str, object]:
        """Return the entry of the quality answer."""
        ratio = self.std / self.noise_std if self.noise_std > 0.0 else np.nan
        return {
            "std": self.std,
            "noise_std": self.noise_std,
            "signal_to_noise": ratio,
            "span": [self.low, self.high],
            "moving_share": self.moving_share,
            "condition": self.condition,
            "excited": self.excited,
        }


def assess(log: Log, noise: dict[str, float]) -> tuple[dict[str, Excitation], float]:
    """Return the excitation by component and the condition number of all that are excited together.

    Args:
        log: the log.
        noise: white-noise standard deviation by channel.

    Returns:
        By name "u" ... "r", and the condition number of [nu, |nu| nu] over the excited components.
    """
    nu = np.concatenate([run.nu for run in log.runs])
    # What has no sensor at all says nothing, and does not silence the others.
    told = np.asarray(np.isfinite(nu).any(axis=0), dtype=bool)
    nu = nu[np.isfinite(nu[:, told]).all(axis=1)]
    result = {}
    for i, name in enumerate(VELOCITY):
        v = nu[:, i]
        if len(v) == 0 or not told[i]:
            result[name] = Excitation(np.nan, np.nan, np.nan, np.nan, 0.0, np.inf)
            continue
        level = noise.get(name, np.nan)
        threshold = max(5.0 * np.nan_to_num(level), _MOVING * float(np.quantile(np.abs(v), 0.99)), _STILL)
        result[name] = Excitation(
            std=float(v.std()),
            noise_std=level,
            low=float(v.min()),
            high=float(v.max()),
            moving_share=float((np.abs(v) > threshold).mean()),
            condition=condition(v[:, None]),
        )
    chosen = [i for i, name in enumerate(VELOCITY) if result[name].excited]
    return result, condition(nu[:, chosen]) if chosen else np.inf


def condition(nu: Array) -> float:
    """Return the condition number of [nu, |nu| nu] with columns of unit length.

    Args:
        nu: velocity components, (N, k).
    """
    if len(nu) < 2 * nu.shape[1]:
        return np.inf
    regressor = np.concatenate([nu, np.abs(nu) * nu], axis=1)
    length = np.linalg.norm(regressor, axis=0)
    if (length <= 0.0).any():
        return np.inf
    regressor /= length
    values = np.linalg.eigvalsh(regressor.T @ regressor)
    return float(np.sqrt(values[-1] / values[0])) if values[0] > 1e-14 * values[-1] else np.inf


def commands(log: Log) -> tuple[bool, list[str], list[str]]:
    """Return whether all commands rest, which rest, and which are at their limit most of the time."""
    resting, saturated = [], []
    columns = command_columns(log)
    for name, values in columns.items():
        good = values[np.isfinite(values)]
        limit = _NEUTRAL if name.startswith("thruster") else 1e-9 if name in DRIVES else 1e-6
        if len(good) == 0 or np.abs(good).max() <= limit:
            resting.append(name)
        elif name.startswith("thruster") and (np.abs(good) >= 0.99).mean() > 0.5:
            saturated.append(name)
    return len(resting) == len(columns), resting, saturated


def command_columns(log: Log) -> dict[str, Array]:
    """Return the commands of all runs by column name, thrusters where there are any, else the wrench."""
    if log.kind == "wrench" and all(run.wrench is None for run in log.runs):
        return {
            name: np.concatenate([run.channels[name] for run in log.runs])
            for name in DRIVES
            if all(name in run.channels for run in log.runs)
        }
    prefix = "thruster_" if log.kind == "thrusters" else "tau_"
    per_run = [dict(run.columns()) for run in log.runs]
    names = [name for name in per_run[0] if name.startswith(prefix) and name not in log.runs[0].extra]
    return {name: np.concatenate([c[name] for c in per_run]) for name in names}
