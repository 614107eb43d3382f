"""Whether commands change between samples so clearly that names need not be sought with held ones first."""

from __future__ import annotations

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.holding import LINEAR, cost_with
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.windows import Windows

# Logarithm of the odds of the straight line against holding at which it is clear: a name may take up a few, and a log of
# minutes at 5 Hz has tens to hundreds.
CLEAR = 20.0


def clearly_between_samples(
    layout: Layout, end: FittedHypothesis, windows: Windows, clear: float = CLEAR
) -> bool:
    """Whether the straight line between commands is likelier than holding them, beyond what a name would change.

    Args:
        layout: of the model as it is stated.
        end: an explanation fitted to held commands.
        windows: those it was fitted to.
        clear: logarithm of the odds beyond which it is.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    if windows.nu_dot is not None:
        return False
    line = Holding("linear", LINEAR, 0.0, 0.0, curves=MeanThrust.of(end.fitted.model))
    sums = end.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)
    costs = [cost_with(law, end, windows, layout=layout) for law in (HELD, line)]
    return 0.5 * (costs[0] - costs[1]) / factor > clear
