"""Is what is left white, and has it nothing to do with the commands? Correlations with bands that really hold.

The errors of free-running windows are not white even where the model is true and the sensors' noise is: each
window's initial state was fitted to them, which takes the slow part out. The textbook band, 2.58 / sqrt(N), is then
wrong. Here white noise is passed through the very projection that the initial states make of it, many times over, and
the band is what comes out.

Reference: Ljung (1999), System Identification, section 16.6; the bands by Monte Carlo are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.comparison.locate import AXES
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.estimation.sensitivity import respond
from auvnn.estimation.window_normal_equations import LOOSE
from auvnn.estimation.window_simulation import simulate_windows
from auvnn.metrics.windows import VELOCITY, Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
NAMES = ("u", "v", "w", "p", "q", "r")
# Two-sided level of every band, draws of noise behind it, and the longest lag, s.
LEVEL, DRAWS, LONGEST = 0.99, 200, 2.0
# Windows behind the bands: more would make them no truer, only slower.
SAMPLED = 10
LAGS = 40
# Windows taken at a time; those behind the bands one by one, which bounds the memory of the draws.
CHUNK = 60


@dataclass(frozen=True)
class ResidualTests:
    """Correlations of what a model leaves, with bands that hold where it is true.

    Attributes:
        lags: s, (K,).
        auto: autocorrelation of each velocity's error, (6, K); NaN where it was not measured.
        auto_low: lower end of its band, (6, K).
        auto_high: upper end, (6, K).
        cross: correlation of each velocity's error with each component of the commanded wrench that many seconds
            before, (6, 6, K).
        cross_low: lower ends, (6, 6, K).
        cross_high: upper ends, (6, 6, K).
    """

    lags: Array
    auto: Array
    auto_low: Array
    auto_high: Array
    cross: Array
    cross_low: Array
    cross_high: Array

    def to_dict(self) -> dict[str, Any]:
        """Return what the answer holds: curves, bands, and how often each leaves its band."""
        out: dict[str, Any] = {"level": LEVEL, "lags": self.lags, "autocorrelation": {}, "with_commands": {}}
        for k, name in enumerate(NAMES):
            if not np.isfinite(self.auto[k]).any():
                continue
            beyond = (self.auto[k] < self.auto_low[k]) | (self.auto[k] > self.auto_high[k])
            out["autocorrelation"][name] = {
                "value": self.auto[k],
                "low": self.auto_low[k],
                "high": self.auto_high[k],
                "outside": float(beyond.mean()),
            }
            rows = {}
            for j, axis in enumerate(AXES):
                value = self.cross[k, j]
                if not np.isfinite(value).any():
                    continue
                half = 0.5 * (self.cross_high[k, j] - self.cross_low[k, j])
                middle = 0.5 * (self.cross_high[k, j] + self.cross_low[k, j])
                excess = np.abs(value - middle) / np.maximum(half, 1e-12)
                at = int(np.nanargmax(excess))
                rows[axis] = {
                    "outside": float((excess > 1).mean()),
                    "largest": float(value[at]),
                    "lag": float(self.lags[at]),
                    "bands": float(excess[at]),
                }
            out["with_commands"][name] = rows
        return out


def residual_tests(explanation: FittedHypothesis, windows: Windows, draws: int = DRAWS) -> ResidualTests:
    """Return the correlations of what an explanation leaves on the windows that it was fitted to.

    Args:
        explanation: a fit; its model and initial states are used.
        windows: those it was fitted to.
        draws: of noise, for the bands.
    """
    fitted = explanation.fitted
    step = float(torch.median(windows.times[:, windows.warmup + 1 :] - windows.times[:, windows.warmup : -1]))
    length = windows.nu.shape[1]
    count = int(min(LAGS, length // 2, max(2, round(LONGEST / max(step, 1e-9)))))
    generator = torch.Generator().manual_seed(0)
    weight = torch.as_tensor(np.where(np.isfinite(fitted.sigma), 1.0 / fitted.sigma, 0.0))
    # A channel that does not count would only be multiplied by zero.
    live = torch.nonzero(weight).flatten()
    weight = weight[live]
    loose = torch.diag(torch.as_tensor(1.0 / LOOSE))
    wrench = _wrench(fitted.model, windows)
    wrench = wrench - wrench.mean((0, 1))
    measured, noise = _CorrelationSums(1, count, live), _CorrelationSums(draws, count, live)
    # The bands come from a share of the windows; their width goes with the root of the number.
    sampled = np.zeros(len(windows), dtype=bool)
    sampled[np.linspace(0, len(windows) - 1, min(SAMPLED, len(windows))).astype(int)] = True
    # Running free costs the same for all windows as for a few.
    ran = simulate_windows(fitted.model, windows, fitted.initial, ())
    for begin in range(0, len(windows), CHUNK):
        some_of_them = slice(begin, begin + CHUNK)
        part = windows.pick(some_of_them)
        answer = respond(fitted.model, part, fitted.initial[some_of_them], (), ran=ran.pick(some_of_them))
        mask = part.mask[..., live]
        state = torch.nn.functional.pad(answer.state, (0, 0, 0, 18 - answer.state.shape[-2]))[..., live, :]
        state = (state * weight[:, None]).reshape(len(part), length * len(live), 12)
        q = torch.linalg.qr(torch.cat([state, loose.expand(len(part), 12, 12)], dim=1))[0][:, :-12]
        tau = wrench[begin : begin + CHUNK]
        measured.add((answer.error[..., live] * weight).unsqueeze(-1), q, mask, tau)
        for k in np.nonzero(sampled[some_of_them])[0]:
            one = slice(k, k + 1)
            drawn = torch.randn(1, length, len(live), draws, generator=generator, dtype=torch.float64)
            noise.add(drawn, q[one], mask[one], tau[one])
    auto, cross = measured.correlations()
    narrower = float(np.sqrt(sampled.mean()))
    bands = [_band(x, narrower) for x in noise.correlations()]
    lags = (step * np.arange(1, count + 1)).astype(np.float64)
    return ResidualTests(lags, auto[0], *bands[0], cross[0], *bands[1])


class _CorrelationSums:
    """Sums of products over windows, for several series at once.

    Args:
        series: how many.
        count: longest lag, samples.
        live: (C,) which of the 18 channels count.
    """

    def __init__(self, series: int, count: int, live: Tensor) -> None:
        self.live = live
        self.own = torch.zeros(series, 6, count + 1, dtype=torch.float64)
        self.with_drive = torch.zeros(series, 6, 6, count, dtype=torch.float64)
        self.drive = torch.zeros(6, 6, dtype=torch.float64)

    def add(self, series: Tensor, q: Tensor, mask: Tensor, tau: Tensor) -> None:
        """Project series (B, L, C, S) as the initial states do, and add what B windows give; mask (B, L, C)."""
        flat = (series * mask.unsqueeze(-1)).flatten(1, 2)
        left = (flat - q @ (q.mT @ flat)).reshape(series.shape) * mask.unsqueeze(-1)
        velocities = torch.arange(18)[VELOCITY]
        told = torch.isin(velocities, self.live)
        error, seen = (
            series.new_zeros(*series.shape[:2], 6, series.shape[3]),
            mask.new_zeros(*mask.shape[:2], 6),
        )
        among = torch.isin(self.live, velocities)
        error[:, :, told], seen[:, :, told] = left[:, :, among], mask[:, :, among]
        length = series.shape[1]
        # Products at all lags at once by the Fourier transform, padded so that no end meets the other.
        padded, lags = 2 * length, self.own.shape[-1]
        errors = torch.fft.rfft(error, n=padded, dim=1)
        drives = torch.fft.rfft(tau, n=padded, dim=1).conj()
        power = torch.einsum("bfcd,bfcd->fdc", errors, errors.conj()).real
        self.own += torch.fft.irfft(power, n=padded, dim=0)[:lags].permute(1, 2, 0)
        both = torch.einsum("bfcd,bfj->fdcj", errors, drives)
        self.with_drive += torch.fft.irfft(both, n=padded, dim=0)[1:lags].permute(1, 2, 3, 0)
        self.drive += torch.einsum("blc,blj->cj", seen, tau**2)

    def correlations(self) -> tuple[Array, Array]:
        """Return autocorrelations (S, 6, K) and those with the wrench before, (S, 6, 6, K)."""
        energy = self.own[:, :, :1]
        auto = self.own[:, :, 1:] / energy
        cross = self.with_drive / torch.sqrt(energy.unsqueeze(-1) * self.drive.unsqueeze(-1))
        return auto.numpy(), cross.numpy()


def _band(drawn: Array, narrower: float) -> tuple[Array, Array]:
    tail = 0.5 * (1.0 - LEVEL)
    middle = drawn.mean(axis=0)
    low, high = np.quantile(drawn, [tail, 1.0 - tail], axis=0)
    return middle + narrower * (low - middle), middle + narrower * (high - middle)


def _wrench(model: GreyBox, windows: Windows) -> Tensor:
    """Return the wrench that the commands stand for, actuators settled, (B, L, 6)."""
    command = windows.inputs.command[:, windows.warmup :]
    with torch.no_grad():
        return model.actuators.static(command) @ model.actuators.allocation.mT
