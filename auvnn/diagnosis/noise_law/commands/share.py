"""By how much of an interval commands that go straight or along a cubic are ahead of the log: asked of a fit to these.

The first question is put to a fit of held commands, whose errors are mostly those of holding: they hide that a controller
of 100 Hz, whose commands are held for 10 ms, is late by 5 ms. A fit to commands between samples sees that, as a lag or a
delay of the thrust if it is told nowhere else.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.holding import (
    LINEAR,
    PLAINER,
    cost_at_best,
    fitted_to,
    laws_of,
    least_share,
    through_thrusts,
)
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import LAWS, between
from auvnn.metrics.windows import Windows

# A share that is so far from one half is asked about one half, too.
MOVED = 0.02


def with_share(layout: Layout, end: FittedHypothesis, windows: Windows, held: Holding) -> Holding:
    """Return how commands go once the share has been asked of a fit to commands that go so.

    Args:
        layout: of the model as it is stated.
        end: the explanation by which commands were asked for.
        windows: of commands at the log's samples, as read.
        held: how commands go by it.

    Raises:
        FitError: the fit has nowhere to begin.
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    if held.name not in LAWS:
        return held
    fit = fitted_to(layout, end, held.applied(windows))
    sums = fit.fitted.statistics
    factor = variance_inflation(sums.slope, sums.total, sums.run)

    def cost(share: float, along: str, curves: MeanThrust | None) -> float:
        some = between(windows, share, along, curves=curves)
        return cost_at_best(fit, some) / factor

    stated = held.curves and replace(held.curves, through_thrusts=False)
    plain = cost_at_best(fit, held.applied(windows)) / factor
    found, most = held, PLAINER
    for name, curves in laws_of(stated):
        far = name == "smooth" and abs(held.share - LINEAR) > MOVED
        for begin in (held.share, LINEAR) if far else (held.share,):
            best = least_share(partial(cost, along=name, curves=curves), begin)
            if best is None:
                continue
            share, least, odds = best
            if 0.5 * (plain - least) + odds > most:
                most, gain = 0.5 * (plain - least) + odds, held.gain + plain - least
                found = replace(held, name=name, share=share, odds=held.odds + most, gain=gain, curves=curves)
    return through_thrusts(found, plain + held.gain, cost)
