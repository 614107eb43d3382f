"""How commands go between samples by a model that states it: the search begins with that.

The statement comes from another log of the same vehicle and recorder. A name fitted to commands that are held, where
they are not, takes up what they do in between, a lag or a delay above all; where such a name leaves nothing that is
significant, nobody asks further. So the statement holds, until a log that is not explained by it is clearly likelier by
another law.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.holding import cost_at_best, cost_with, fitted_to, holding
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.estimation.prediction_error import FitError
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.stated import interval_of
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox


@dataclass(frozen=True)
class StatedCommands:
    """Commands that go between samples as the model states it.

    Attributes:
        read: windows of commands as they were read.
        law: that the model states.
    """

    read: Windows
    law: Holding

    def as_read(self, windows: Windows) -> Windows:
        """Return the windows of commands as read, with the steps that others have come to need."""
        return replace(self.read, max_step=windows.max_step)


def stated_commands(model: GreyBox, windows: Windows) -> StatedCommands | None:
    """Return how commands go by the model's statement; None where it states nothing for such an interval between samples.

    Args:
        model: as known.
        windows: of commands as read.
    """
    path = model.commands
    # An acceleration is measured at an instant: the mean over an interval says nothing of it.
    if path is None or not path.counts_at(interval_of(windows)) or windows.nu_dot is not None:
        return None
    curves = None if path.between_samples == "averaged" else MeanThrust.of(model)
    if curves is not None and path.interpolated == "thrust":
        curves = curves.of_thrusts()
    law = Holding(path.between_samples, path.share_of_next, 0.0, 0.0, path.samples, curves, stated=True)
    return StatedCommands(windows, law)


def still_stated(
    layout: Layout, stated: StatedCommands, least: FittedHypothesis, windows: Windows
) -> Holding | None:
    """Return the stated law, with its odds against holding; None where the log is clearly likelier by another one.

    Another law, holding among them, is asked of a fit to commands as read: about one to stated commands that are wrong
    the first order says nothing of others. What cannot be compared stays as it is stated.

    Args:
        layout: of the model as it is stated.
        stated: how commands go by the model, and windows of commands as read.
        least: the explanation that leaves least, fitted to commands that go so.
        windows: those it was fitted to.
    """
    read, sums, sigma = stated.as_read(windows), least.fitted.statistics, least.fitted.sigma
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    with suppress(FitError, np.linalg.LinAlgError):
        held = fitted_to(layout, least, read, sigma)
        plain, by_statement = cost_at_best(held, read, sigma), cost_at_best(least, windows, sigma)
        otherwise = cost_with(holding(held, read, layout), held, read, sigma, layout)
        if 0.5 * (by_statement - min(plain, otherwise)) / factor > ODDS:
            return None
        gain = (plain - by_statement) / factor
        return replace(stated.law, odds=0.5 * gain, gain=gain)
    return stated.law
