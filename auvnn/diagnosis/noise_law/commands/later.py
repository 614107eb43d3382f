"""Names of a lag or a delay that only say by how much of an interval commands act later than the law of them has it.

The share of the next command is asked of a fit without these names, which other names may have blurred. Once they are
found it is asked again without those that change when a command acts: where it moves by what they did, no cause is there.
A controller of 100 Hz whose commands are held for 10 ms is late by 5 ms in every log, and a propeller's lag of 5 ms, with
0.2 s between samples, was called a cause.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.standard_errors import of_timing
from auvnn.diagnosis.noise_law.commands.holding import cost_at_best, cost_with
from auvnn.diagnosis.noise_law.commands.in_place_of_names import PARAMETER, without_timed
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.noise_law.commands.share import with_share
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.metrics.commands.paths import LAWS
from auvnn.metrics.windows import Windows

# Standard deviations of a moment within an interval up to which a lag or a delay may be nothing else.
WITHIN = 2.0
# Share of what the names did that the law may leave: it moves commands, and a lag smooths them, too.
REST = 0.2


def late_by_a_share(
    asked: Setting, state: State, raw: Windows, held: Holding
) -> tuple[FittedHypothesis, Holding] | None:
    """Return the explanation without names of timing, and the law of the commands that does what they did; or None.

    Args:
        asked: what is asked.
        state: where a search with commands that go between samples has ended.
        raw: windows of commands at the log's samples, as read.
        held: the law that it took.
    """
    end = state.current
    if held.name not in LAWS or held.odds <= 0.0 or not _within_an_interval(end, state.windows):
        return None
    with suppress(*UNSOLVED):
        fewer = without_timed(asked, state, end)
        if fewer is None:
            return None
        law = with_share(asked.layout, fewer, raw, held)
        if (law.name, law.share) == (held.name, held.share):
            return None
        sigma, sums = end.fitted.sigma, end.fitted.statistics
        factor = variance_inflation(sums.slope, sums.total, sums.run)
        named = cost_at_best(end, state.windows, sigma)
        alone = cost_with(law, fewer, raw, sigma, asked.layout)
        spared = len(end.fitted.theta) - len(fewer.fitted.theta)
        did = cost_at_best(fewer, state.windows, sigma) - named
        if alone - named <= max(PARAMETER * spared * factor, REST * did):
            return fewer, law
    return None


def _within_an_interval(end: FittedHypothesis, windows: Windows) -> bool:
    """Whether the names of timing are there, and none of them is clearly longer than a part of an interval."""
    model, at, found = end.fitted.model, 0, False
    open_to = of_timing(model, end.names, windows)
    for name in end.names:
        for parameter in model.effect(name).parameters_of:
            if name in end.effects and parameter.timing:
                assert open_to is not None
                found = True
                if abs(float(end.fitted.theta[at]) - parameter.null) > WITHIN * float(open_to[at]):
                    return False
            at += 1
    return found and bool(np.isfinite(end.fitted.theta).all())
