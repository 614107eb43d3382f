"""How a command goes from one sample to the next: held, on a straight line, or changed ahead of its sample.

A log has the command at its samples alone. A controller that runs faster changes it in between, and a model that holds
the sample's command for the whole interval then lags behind by a part of it: errors that look like those of a lag or a
delay. What moves the vehicle over an interval is the mean of the command, and that is taken as

    (1 - share) u_k + share u_(k+1):

a share of nought holds the command, one half is the straight line, anything between nought and one a command that
changes so much of an interval before its sample. Commands that change later than logged are another matter: that is
`actuation_delay`. The log is asked by the likelihood of free running with everything that is uncertain following.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.normal_equations import linearise, normal_equations
from auvnn.metrics.windows import Windows

LINEAR = 0.5
# Where the straight line does as well as a share of its own up to these odds, it is the plainer answer.
PLAINER = float(np.log(10.0))


@dataclass(frozen=True)
class Holding:
    """How commands go from sample to sample, by a log.

    Attributes:
        name: "held", "linear" or "ahead".
        share: of the next sample's command in an interval's mean.
        odds: logarithm of the odds against holding; nought where it is held.
        gain: fall of the weighted squared error, for the variance that the windows show.
    """

    name: str
    share: float
    odds: float
    gain: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {"between_samples": self.name, "share_of_next": self.share, "log_odds": self.odds}


def between(windows: Windows, share: float) -> Windows:
    """Return windows whose commands and fins have so much of the next sample's in every interval."""
    if share == 0.0:
        return windows
    given = windows.inputs

    def mixed(values: Tensor) -> Tensor:
        return (1.0 - share) * values + share * torch.cat([values[:, 1:], values[:, -1:]], dim=1)

    fins = None if given.fins is None else mixed(given.fins)
    return replace(windows, inputs=replace(given, command=mixed(given.command), fins=fins))


def holding(first: FittedHypothesis, windows: Windows) -> Holding:
    """Ask how commands go from sample to sample.

    The squared error is taken as a parabola of the share, through nought, one half and one.

    Args:
        first: the fit without any effect, of commands that are held.
        windows: those it was fitted to.
    """
    held = Holding("held", 0.0, 0.0, 0.0)
    # An acceleration is measured at an instant: the mean over an interval says nothing of it.
    if windows.nu_dot is not None:
        return held
    sums = first.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    costs = [_cost(first, between(windows, share)) / factor for share in (0.0, LINEAR, 1.0)]
    gain = costs[0] - costs[1]
    bend = 2.0 * (costs[0] - 2.0 * costs[1] + costs[2])
    found = Holding("linear", LINEAR, 0.5 * gain, gain)
    if bend > 0.0:
        share = float(np.clip(LINEAR - (costs[2] - costs[0]) / (2.0 * bend), 0.0, 1.0))
        # c(s) = c(1/2) + slope (s - 1/2) + bend (s - 1/2)^2, with slope = c(1) - c(0).
        most = gain - (costs[2] - costs[0]) * (share - LINEAR) - bend * (share - LINEAR) ** 2
        spread = min(1.0 / np.sqrt(bend), 1.0)
        odds = 0.5 * most + min(float(np.log(np.sqrt(2.0 * np.pi) * spread)), 0.0)
        if odds > found.odds + PLAINER:
            found = Holding("ahead", share, odds, most)
    return found if found.odds > ODDS else held


def _cost(first: FittedHypothesis, windows: Windows) -> float:
    """Return the squared error with everything that is uncertain following, to first order."""
    fitted = first.fitted
    sums, _, _ = normal_equations(
        windows, linearise(fitted.model, windows, fitted.initial, first.names), fitted.sigma
    )
    inside = fitted.priors.inside(fitted.theta)
    precision = fitted.priors.precision[inside]
    pull = sums.slope.sum(0)[inside] - precision * (fitted.theta - fitted.priors.mean)[inside]
    square = sums.total[np.ix_(inside, inside)] + np.diag(precision)
    step = np.linalg.lstsq(square, pull, rcond=1e-12)[0] if inside.any() else np.zeros(0)
    return float(sums.cost.sum() - (pull @ step if inside.any() else 0.0))
