"""Is the sensors' noise white? Asked of the log by evidence, against a stochastic force that may explain the same.

Noise that is correlated over half a second, as filters and estimators make it, looks like a force to whoever takes it
for white: errors that last. But it does not add up as a force does. So the likelihood of white noise beside a stochastic
force, which is integrated out, is compared with that of noise of a few correlation times without any force; then each
sensor may have a time of its own, or go back to white.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.commands.holding import cost_at_best
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.noise_law.likelihood.estimate_law import estimate
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import force_sums
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.coloured_noise import NoiseColour
from auvnn.metrics.windows import ATTITUDE, POSITION, Windows

Array = NDArray[np.float64]
# Correlation times that are tried, s. What lasts longer is no noise of a sensor: it could be anything that a model lacks.
TIMES = (0.1, 0.25, 0.6)
# Of the best one, for each sensor separately.
FACTORS = (0.0, 0.55)
# Correlation time, s, and logarithm of the odds by which noise is clearly coloured, whatever else is missing.
CLEAR_TIME, CLEAR_ODDS = 0.25, 1000.0
SENSORS = {"position": POSITION, "attitude": ATTITUDE, "velocity": slice(6, 9), "rates": slice(9, 12)}
# Correlation time, s, of the innovations in which outliers are looked for; how many standard deviations are too many.
INNOVATION, OUTLIER, NORMAL = 0.3, 6.0, 1.4826


@dataclass(frozen=True)
class Colour:
    """What a log says about the colour of its sensors' noise.

    Attributes:
        noise: correlation times; None where white noise does as well.
        odds: logarithm of the odds against white noise.
        mask: (B, L, 18) of the windows, without single measurements that such noise does not bring about; None as it is.
    """

    noise: NoiseColour | None
    odds: float
    mask: Tensor | None = None

    def applied(self, windows: Windows) -> Windows:
        """Return windows with that noise."""
        if self.noise is None or self.mask is None:
            return windows
        return replace(windows, noise=self.noise, mask=self.mask)

    def to_dict(self) -> dict[str, float]:
        """Return the correlation time of each sensor whose noise is not white, s."""
        if self.noise is None:
            return {}
        times = {name: float(self.noise.time[place][0]) for name, place in SENSORS.items()}
        return {name: time for name, time in times.items() if time > 0.0}


def noise_colour(
    explanation: FittedHypothesis, windows: Windows, floor: Array, others: Iterable[FittedHypothesis] = ()
) -> Colour:
    """Ask a log for the colour of its noise.

    Args:
        explanation: a fit that leaves little.
        windows: those it was fitted to, as if noise were white.
        floor: (18,) below which no channel is trusted.
        others: other fits, perhaps made one after the other as they are asked for. What an absent effect does to the
            sensors looks like a colour of their noise: where white noise beside one of these is likelier than any colour,
            it is white.
    """
    windows = replace(windows, mask=without_outliers(explanation, windows))
    cost_of = _Costs(explanation, windows, floor)
    plain, best = cost_of(np.zeros(18)), _best_time(cost_of)
    # Said so that numbers which are none answer no.
    if not 0.5 * (plain - best[0]) > ODDS:
        return Colour(None, 0.0)
    for other in others:
        beside = _Costs(other, windows, floor)
        with suppress(*UNSOLVED):
            likely = beside(np.zeros(18))
            if likely < best[0] and likely < _best_time(beside)[0]:
                return Colour(None, 0.0)
    for place in SENSORS.values():
        if not np.isfinite(explanation.fitted.sigma[place]).any():
            continue
        for factor in FACTORS:
            times = best[1].copy()
            times[place] *= factor
            best = min(best, (cost_of(times), times), key=lambda found: found[0])
    return Colour(NoiseColour(best[1]), 0.5 * (plain - best[0]), windows.mask)


def _best_time(cost_of: _Costs) -> tuple[float, Array]:
    """Return the least cost of noise of one correlation time in all sensors, and the times (18,)."""
    all_times = (np.where(np.arange(18) < 12, time, 0.0) for time in TIMES)
    return min(((cost_of(times), times) for times in all_times), key=lambda found: found[0])


def clearly_coloured(explanation: FittedHypothesis, windows: Windows, floor: Array) -> bool:
    """Whether the noise has so clear a colour that no other effect has to be named before it is asked for.

    One correlation time is compared with white noise beside a stochastic force: without the right effects the force is
    larger, so that a force, and no colour, is preferred too often, not too seldom.

    Args:
        explanation: a fit, perhaps one that leaves much.
        windows: those it was fitted to, as if noise were white.
        floor: (18,) below which no channel is trusted.
    """
    windows = replace(windows, mask=without_outliers(explanation, windows))
    cost_of = _Costs(explanation, windows, floor)
    times = np.where(np.arange(18) < 12, CLEAR_TIME, 0.0)
    return bool(0.5 * (cost_of(np.zeros(18)) - cost_of(times)) > CLEAR_ODDS)


def without_outliers(explanation: FittedHypothesis, windows: Windows) -> Tensor:
    """Return the windows' mask (B, L, 18) without measurements whose innovation is far out.

    A single false value counts once where noise is white, but many times where it is expected to be near the last one:
    left in, a few of them refute every colour.

    Args:
        explanation: the fit.
        windows: those it was fitted to.
    """
    fitted = explanation.fitted
    asked = replace(windows, noise=NoiseColour(np.where(np.arange(18) < 12, INNOVATION, 0.0)))
    error = torch.cat([r.error for r in linearise(fitted.model, asked, fitted.initial, ())])
    size = torch.where(windows.mask > 0, error.abs(), torch.nan).flatten(0, 1).nanmedian(0).values
    far = error.abs() > OUTLIER * NORMAL * size
    return torch.where(far & torch.isfinite(size), torch.zeros_like(windows.mask), windows.mask)


class _Costs:
    """Minus twice the log likelihood of colours; of white noise with a stochastic force beside it."""

    def __init__(self, explanation: FittedHypothesis, windows: Windows, floor: Array) -> None:
        self.explanation, self.windows, self.floor = explanation, windows, floor

    def __call__(self, times: Array) -> float:
        colour = NoiseColour(times)
        windows = replace(self.windows, noise=colour)
        fitted = self.explanation.fitted
        # Innovations have a white part of their own.
        plain, _, _ = normal_equations(
            windows, linearise(fitted.model, windows, fitted.initial, ()), fitted.sigma
        )
        own = replace(self.explanation, fitted=replace(fitted, statistics=plain))
        sigma = white(own, self.floor)
        if times.any():
            value = cost_at_best(self.explanation, windows, sigma)
        else:
            likelihood = Likelihood(force_sums(self.explanation, windows, sigma))
            value = likelihood.of(estimate(likelihood).law)[0]
        seen = np.isfinite(sigma)
        mask = windows.mask * (windows.mask.new_tensor(seen.astype(float)))
        counts = mask.sum((0, 1)).numpy()
        volume = 2.0 * float((counts[seen] * np.log(sigma[seen])).sum())
        return value + volume + colour.log_determinant(mask, windows.times[:, windows.warmup :])
