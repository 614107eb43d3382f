"""The table of candidates: each by its test at the null, the leading ones by a separate fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import ByEffect, Candidate, Parameters, Similar
from auvnn.diagnosis.answers.describe_parameters import describe_parameters
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.standard_errors import standard_errors
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.residuals.autocorrelation import excess_variance
from auvnn.diagnosis.score_tests.score import Score

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CandidateRow:
    """A row of the table of candidates.

    Attributes:
        effect: name.
        needs: channels that the log lacks for it.
        p_value: of its test at the null; None where there is none.
        explained: share of what is left that it explains.
        cv_before: error on what is left out without it, in weighted standard deviations.
        cv_after: the same with it.
        parameters: as its test or its fit has them.
        confusable_with: effects that leave a similar trace, the most similar first.
        reason: why its fit failed.
        order: evidence by which candidates are listed.
    """

    effect: str
    needs: list[str]
    p_value: float | None = None
    explained: float | None = None
    cv_before: float | None = None
    cv_after: float | None = None
    parameters: Parameters = field(default_factory=dict)
    confusable_with: list[Similar] = field(default_factory=list)
    reason: str | None = None
    order: float = -np.inf

    def to_dict(self) -> Candidate:
        """Return what the answer holds."""
        return {
            "effect": self.effect,
            "p_value": self.p_value,
            "explained": self.explained,
            "cv_before": self.cv_before,
            "cv_after": self.cv_after,
            "parameters": self.parameters,
            "confusable_with": self.confusable_with,
            "needs": self.needs,
            "reason": self.reason,
        }


def candidate_table(
    layout: Layout,
    scores: dict[str, Score],
    current: FittedHypothesis,
    similar: tuple[list[str], Array],
    needs: dict[str, list[str]],
) -> dict[str, CandidateRow]:
    """Return an entry for every effect that was wanted, by its test at the null; see `formats` of the answer.

    Args:
        layout: stated values.
        scores: the tests.
        current: the fit at which they were made.
        similar: effects, and how much of each one's trace another can imitate.
        needs: effects wanted, and the channels that the log lacks for them.
    """
    names, matrix = similar
    whole = max(excess_variance(current, current), max((s.gain for s in scores.values()), default=0.0), 1e-12)
    table: dict[str, CandidateRow] = {}
    for name, absent in needs.items():
        found = scores.get(name)
        entry = CandidateRow(name, absent)
        if found is not None:
            row = names.index(name)
            near = sorted(((matrix[row, j], names[j]) for j in range(len(names)) if j != row), reverse=True)
            entry = replace(
                entry,
                p_value=found.p_value,
                explained=float(np.clip(found.gain / whole, 0.0, 1.0)),
                cv_before=current.cv,
                cv_after=predicted_left_out(current, found),
                parameters=describe_parameters(layout.model.effect(name), found.estimate, found.std),
                confusable_with=[{"effect": n, "similarity": float(v)} for v, n in near if v >= 0.5],
                order=found.evidence,
            )
        table[name] = entry
    return table


def fill_candidate(
    layout: Layout,
    table: Mapping[str, CandidateRow],
    explanation: FittedHypothesis,
    before: FittedHypothesis,
    without: Mapping[str, FittedHypothesis] | None = None,
) -> dict[str, CandidateRow]:
    """Return the table with the one-step figures of an explanation's effects replaced by those of its own fit.

    Args:
        layout: stated values.
        table: the candidates.
        explanation: the fit.
        before: the fit without any effect.
        without: of several effects, the fits without each: what an effect does is what it does in addition to the others.
    """
    found, out = values(layout, explanation, explanation.effects), dict(table)
    whole = max(excess_variance(before, before), 1e-12)
    after = _scaled_left_out(explanation, before)
    for name in explanation.effects:
        count = before.left_out_count.sum()
        cv_before = before.cv
        if without is not None and name in without and without[name] is not before:
            cv_before = float(np.sqrt(max(_scaled_left_out(without[name], before), 0.0) / count))
        explained = out[name].explained
        if without is not None and name in without:
            fall = excess_variance(without[name], before) - excess_variance(explanation, before)
            explained = float(np.clip(fall / whole, 0.0, 1.0))
        out[name] = replace(
            out[name],
            parameters=found[name],
            cv_before=cv_before,
            cv_after=float(np.sqrt(max(after, 0.0) / count)),
            explained=explained,
        )
    return out


def values(layout: Layout, found: FittedHypothesis, wanted: Sequence[str]) -> ByEffect:
    """Return the named effects' parameters as fitted, with their standard errors, as answers hold them.

    Args:
        layout: which columns belong to which effect.
        found: the fit.
        wanted: names of the effects to report.
    """
    places = {n: at for n, at in layout.places(found.names).items() if n in wanted}
    return {
        n: describe_parameters(layout.model.effect(n), found.fitted.theta[at], standard_errors(found, at)[0])
        for n, at in places.items()
    }


def predicted_left_out(current: FittedHypothesis, found: Score) -> float:
    """Return the error on what was left out that a test's one-step estimate promises."""
    left = max(current.left_out.sum() - (found.gain - found.degrees), 0.0)
    return float(np.sqrt(left / max(current.left_out_count.sum(), 1.0)))


def _scaled_left_out(explanation: FittedHypothesis, before: FittedHypothesis) -> float:
    """Return an explanation's left-out error in the weights of the explanation before it."""
    mine, theirs = explanation.fitted.sigma, before.fitted.sigma
    if np.allclose(mine[np.isfinite(mine)], theirs[np.isfinite(mine)]):
        return float(explanation.left_out.sum())
    usable = np.isfinite(mine)
    sums = explanation.fitted.statistics.channel.sum(0)[usable]
    inflated = explanation.left_out.sum() / max(explanation.fitted.statistics.cost.sum(), 1e-12)
    return float((sums / theirs[usable] ** 2).sum() * inflated)
