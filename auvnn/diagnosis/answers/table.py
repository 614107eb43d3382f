"""The table of candidates: each by its test at the null, the leading ones by a fit of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.answers.describe_parameters import describe_parameters
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, standard_errors
from auvnn.diagnosis.hypotheses.layout import Layout
from auvnn.diagnosis.residuals.autocorrelation import excess_variance
from auvnn.diagnosis.score_tests.score import Score

Array = NDArray[np.float64]


def candidate_table(
    layout: Layout,
    scores: dict[str, Score],
    current: FittedHypothesis,
    similar: tuple[list[str], Array],
    needs: dict[str, list[str]],
) -> dict[str, dict[str, Any]]:
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
    table: dict[str, dict[str, Any]] = {}
    for name, absent in needs.items():
        found = scores.get(name)
        entry: dict[str, Any] = {
            "effect": name,
            "p_value": None,
            "explained": None,
            "cv_before": None,
            "cv_after": None,
            "parameters": {},
            "confusable_with": [],
            "needs": absent,
            "_order": -np.inf,
        }
        if found is not None:
            row = names.index(name)
            near = sorted(((matrix[row, j], names[j]) for j in range(len(names)) if j != row), reverse=True)
            entry.update(
                p_value=found.p_value,
                explained=float(np.clip(found.gain / whole, 0.0, 1.0)),
                cv_before=current.cv,
                cv_after=predicted_left_out(current, found),
                parameters=describe_parameters(layout.model.effect(name), found.estimate, found.std),
                confusable_with=[{"effect": n, "similarity": float(v)} for v, n in near if v >= 0.5],
                _order=found.evidence,
            )
        table[name] = entry
    return table


def fill_candidate(
    layout: Layout, table: dict[str, dict[str, Any]], explanation: FittedHypothesis, before: FittedHypothesis
) -> None:
    """Replace the one-step figures of an effect by those of its own fit."""
    found = values(layout, explanation, explanation.effects)
    for name in explanation.effects:
        table[name].update(
            cv_before=before.cv,
            cv_after=float(np.sqrt(_scaled_left_out(explanation, before) / before.left_out_count.sum())),
            parameters=found[name],
        )


def values(
    layout: Layout, found: FittedHypothesis, wanted: Sequence[str]
) -> dict[str, dict[str, dict[str, Any]]]:
    """Return the named effects' parameters as fitted, with their standard errors, as answers hold them."""
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
