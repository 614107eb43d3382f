"""One channel of a log: how much is missing, how noisy it is, whether the sensor stood still."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.channels import unit
from auvnn.logs.signals.noise import noise_std

if TYPE_CHECKING:
    from auvnn.logs.log import Log
    from auvnn.logs.run import Run

Array = NDArray[np.float64]

_FROZEN_SECONDS = 1.0
_FROZEN_SAMPLES = 10


@dataclass(frozen=True)
class Channel:
    """What can be said of one channel.

    Args:
        unit: SI unit, None for a column outside the contract.
        missing_share: share of missing samples.
        std: standard deviation.
        low: smallest value.
        high: largest value.
        noise_std: white noise, median over the runs.
        frozen_share: share of samples in stretches of at least 1 s and ten samples without any change.
        repeated_share: share of samples equal to the one before.
        spikes: single samples that leave their neighbours and come back.
        constant: whether the channel never changes.
    """

    unit: str | None
    missing_share: float
    std: float
    low: float
    high: float
    noise_std: float
    frozen_share: float
    repeated_share: float
    spikes: int
    constant: bool

    def to_dict(self) -> dict[str, object]:
        """Return the entry of the quality answer."""
        return {
            "unit": self.unit,
            "missing_share": self.missing_share,
            "std": self.std,
            "min": self.low,
            "max": self.high,
            "noise_std": self.noise_std,
            "frozen_share": self.frozen_share,
            "repeated_share": self.repeated_share,
            "spikes": self.spikes,
        }


def assess(log: Log) -> dict[str, Channel]:
    """Return what can be said of every channel, by column name, `t` left out."""
    per_run = [dict(run.columns()) for run in log.runs]
    names = dict.fromkeys(name for columns in per_run for name in columns if name != "t")
    result = {}
    for name in names:
        present = [(run, c[name]) for run, c in zip(log.runs, per_run, strict=True) if name in c]
        result[name] = _channel(name, present, log.samples)
    return result


def frozen(run: Run, y: Array) -> NDArray[np.bool_]:
    """Return the samples (N,) in stretches of at least 1 s and ten samples in which y does not change."""
    same = np.concatenate([[False], y[1:] == y[:-1]])
    starts = np.flatnonzero(~same)
    lengths = np.diff(np.append(starts, len(y)))
    ends = starts + lengths - 1
    long = (lengths >= _FROZEN_SAMPLES) & (run.t[ends] - run.t[starts] >= _FROZEN_SECONDS)
    return np.repeat(long, lengths)


def _channel(name: str, present: list[tuple[Run, Array]], samples: int) -> Channel:
    values = np.concatenate([y for _, y in present])
    good = values[np.isfinite(values)]
    noise = [float(noise_std(run.t, y)) for run, y in present]
    noise = [n for n in noise if np.isfinite(n)]
    pairs = sum(int((np.isfinite(y[1:]) & np.isfinite(y[:-1])).sum()) for _, y in present)
    repeated = sum(int((y[1:] == y[:-1]).sum()) for _, y in present)
    stuck = sum(int(frozen(run, y).sum()) for run, y in present)
    spikes = sum(int(run.outliers[name].sum()) for run, _ in present if name in run.outliers)
    return Channel(
        unit=unit(name),
        missing_share=1.0 - len(good) / samples,
        std=float(good.std()) if len(good) else np.nan,
        low=float(good.min()) if len(good) else np.nan,
        high=float(good.max()) if len(good) else np.nan,
        noise_std=float(np.median(noise)) if noise else np.nan,
        frozen_share=stuck / samples,
        repeated_share=repeated / pairs if pairs else 0.0,
        spikes=spikes,
        constant=bool(len(good) > 1 and good.min() == good.max()),
    )
