"""How commands go between samples by a model that states it: the search begins with that.

The statement comes from another log of the same vehicle and recorder. A name fitted to commands that are held, where
they are not, takes up what they do in between, a lag or a delay above all; where such a name leaves nothing that is
significant, nobody asks further. So the statement holds, until a log that is not explained by it is clearly likelier by
another law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.holding import cost_with
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
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


def unless_likelier(
    layout: Layout, stated: Holding, found: Holding, least: FittedHypothesis, read: Windows
) -> Holding:
    """Return the stated law, with its odds against holding, or the one asked of the log where that is clearly likelier.

    Args:
        layout: of the model as it is stated.
        stated: the law that the model states.
        found: how commands go by the log.
        least: the explanation by which it was asked.
        read: windows of commands as read.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    sums = least.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    held, by_statement, otherwise = (
        cost_with(law, least, read, layout=layout) / factor for law in (HELD, stated, found)
    )
    if 0.5 * (by_statement - otherwise) > ODDS:
        return found
    return replace(stated, odds=0.5 * (held - by_statement), gain=held - by_statement)
