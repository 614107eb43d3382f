"""Whether what an explanation says happens within the log.

A load that is taken before the log begins, or at its first sample, is weight, water and drag that were there all along:
with a dozen parameters it imitates whatever is constant and missing (drag of the fins, a buoyancy), which has a plainer
name or none. An effect that begins at some time is therefore only named where that is seen.
"""

from __future__ import annotations

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.score_tests.probes import extent_of
from auvnn.metrics.windows import Windows


def within_record(explanation: FittedHypothesis, windows: Windows) -> bool:
    """Return whether the effect that came last happens while something is recorded.

    Args:
        explanation: with at least one effect.
        windows: of the log.
    """
    effect = explanation.fitted.model.effect(explanation.effects[-1])
    values = {p.name: float(v) for p, v in zip(effect.parameters_of, effect.theta.detach(), strict=True)}
    return effect.happens(values, extent_of(windows))
