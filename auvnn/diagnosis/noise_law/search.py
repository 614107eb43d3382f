"""Names together with a stochastic force: explanations are compared again, each with the law that is most likely with it.

Where no force is left, nothing here is asked and the answer is that of the search without one. Else the law of the
force is estimated at the fit without any name. An effect that is absent from the model inflates the variance that then
hides it: those that lead with the variance at zero, which the first search has fitted in full, are therefore compared
with those that lead under the law. Each explanation is judged by its marginal likelihood at its own law, forces and
initial states integrated out and its parameters following the law, and by how well it predicts runs left out.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, initial_guess, shapes
from auvnn.diagnosis.noise_law.estimate_law import estimate
from auvnn.diagnosis.noise_law.hypothesis import (
    GROUP,
    Hypothesis,
    WithForce,
    confused,
    free_running_cost,
    judged,
    p_value_of,
    predicts_better,
    tied,
)
from auvnn.diagnosis.noise_law.leaders import rivals_of
from auvnn.diagnosis.noise_law.predicted_by_inputs import predicted_by_inputs
from auvnn.diagnosis.noise_law.relinearise import UNSOLVED, relinearised
from auvnn.diagnosis.noise_law.sums import CELL, force_sums
from auvnn.diagnosis.score_tests.null_tests import NullTests, Tested
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.choose import ALPHA
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.stages.state import Setting
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.metrics.force_law import ForceLaw, cell_for
from auvnn.metrics.rollouts import scale_of
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# A name is given where chance would seldom do as well among all effects that were asked for; a further one on
# stronger grounds, because each time chance gets another turn.
ALPHA_NAME, ALPHA_FURTHER = 0.01, 0.001
# Standard errors by which runs left out must be predicted better.
GAIN, GAIN_FURTHER = 1.0, 2.0
# Fitted in full beside those that the first search has fitted: so many of those that lead under the law.
LEADERS = 3
STEPS = 6
# Share of the odds that a further name needs, which its test must promise before it is fitted.
WORTH_A_FIT = 0.3
# What the first name and a further one must cost in free running, as shares of the tolerance: both fits are to all of the
# log, and a force that is always there makes errors that no name takes away. And the share of the gain of all names
# that a further one must bring.
FIRST_COST, FURTHER_COST, FURTHER_SHARE = 0.5, 1.0, 0.1


class ForceSearch:
    """The search together with a stochastic force, of one log.

    Args:
        asked: what is asked.
        windows: of the log, without a law.
    """

    def __init__(self, asked: Setting, windows: Windows) -> None:
        """Begin without a law."""
        self.layout, self.windows, self.tolerance = asked.layout, windows, asked.tolerance
        self.usable, self.base, self.say = list(asked.usable), list(asked.base), asked.say
        self.log, self.scale = asked.log, scale_of(asked.log)
        self.sigma = self.weights = np.full(18, np.inf)
        self.cell = CELL
        self.ignores_cost, self.looks_further = asked.tolerance.strict, False
        self._first_look: tuple[Hypothesis, Tested, list[Hypothesis]] | None = None

    def begin(self, first: FittedHypothesis, sigma: Array) -> Hypothesis | None:
        """Return the explanation without any name under the law of the force; None where no variance is above zero.

        Args:
            first: the fit without any effect.
            sigma: (18,) the sensors' white noise.
        """
        self.say("estimating the law of the force that is left")
        # Fits without the force weigh errors as the first one did, the force's among them.
        self.sigma, self.weights = sigma, first.fitted.sigma
        found = estimate(force_sums(first, self.windows, sigma, self.cell))
        if found.law is None:
            return None
        cell = cell_for(found.law.time[found.law.axes])
        if cell < self.cell:
            self.cell = cell
            found = estimate(
                force_sums(first, self.windows, sigma, cell), replace(found.law, cell=cell), found.law.axes
            )
        assert found.law is not None
        return self.judged(first, found.law)

    def judged(self, explanation: FittedHypothesis, law: ForceLaw) -> Hypothesis:
        """Return an explanation with the law that is most likely with it, and what they are worth."""
        sums = force_sums(explanation, self.windows, self.sigma, self.cell)
        return judged(self.layout, explanation, sums, self.sigma, law)

    def run(self, null: Hypothesis, fitted: Sequence[FittedHypothesis], most: int) -> WithForce:
        """Search for one effect after the other.

        Args:
            null: from `begin`.
            fitted: explanations of one effect that the first search has fitted.
            most: look for at most this many.
        """
        current, chosen = null, []
        steps: list[SearchStep] = []
        groups: list[list[FittedHypothesis]] = []
        tried: list[Hypothesis] = []
        whole = 1.0
        while len(chosen) < most:
            law = current.estimate.law
            assert law is not None
            grouped = {e.effects[-1] for g in groups for e in g}
            remaining = [n for n in self.usable if n not in chosen and n not in grouped]
            if not remaining:
                break
            self.say(f"testing {len(remaining)} effects together with the force")
            base = [*self.base, *[c for c in chosen if c not in self.base]]
            # A second search begins with the same look.
            seen = self._first_look if not chosen else None
            known = seen[1:] if seen is not None and seen[0] is null else None
            tested = (
                known[0]
                if known
                else NullTests(self.layout, replace(self.windows, law=law), self.say)(
                    current.weighed, remaining, base, chosen
                )
            )
            # Beside what was found the variance is no longer inflated by it: the tests say whether to go on.
            if chosen and tested.p_value >= ALPHA:
                break
            share = 0.0 if self.looks_further else FURTHER_SHARE
            odds = max(ODDS, share * (current.evidence - null.evidence))
            found = known[1] if known else self._fitted(tested, current, base, chosen, fitted, odds)
            if not chosen:
                self._first_look = null, tested, found
            sure = {h.name: min(1.0, len(remaining) * p_value_of(self.layout, h, current)) for h in found}
            if not chosen:
                tried = found
                whole = min([tested.p_value, *sure.values()], default=1.0)
            level, least = (ALPHA_FURTHER, GAIN_FURTHER) if chosen else (ALPHA_NAME, GAIN)
            likely = [
                h
                for h in found
                if h.evidence > current.evidence + odds
                and sure[h.name] < level
                and predicts_better(h, current, least)
            ]
            good = self._paying(likely, current, FURTHER_COST if chosen else FIRST_COST)
            if not good or (chosen and self._takes_up(good[0], chosen)):
                break
            group = tied(self.layout, good, current)
            if len(group) > GROUP:
                break
            names = [h.name for h in group]
            verdict = "ambiguous" if len(group) > 1 else "named"
            steps.append({"verdict": verdict, "effects": names, "p_value": sure[group[0].name]})
            current = relinearised(group[0], self.windows, self.weights, self.judged)
            if len(group) > 1:
                groups.append([current.explanation, *(h.explanation for h in group[1:])])
            chosen.append(group[0].name)
        law = current.estimate.law
        assert law is not None
        return WithForce(
            steps,
            groups,
            current.explanation,
            replace(self.windows, law=law),
            current.estimate,
            [h.explanation for h in tried],
            whole,
            null.estimate.law,
        )

    def _paying(self, likely: Sequence[Hypothesis], current: Hypothesis, share: float) -> list[Hypothesis]:
        """Return those explanations that cost enough, none where a likelier one makes free running worse.

        What the data prefer at odds of a hundred, and what free running contradicts, says that neither can be trusted.

        Args:
            likely: explanations, the most evident first.
            current: that without them.
            share: of the tolerated cost that is enough.
        """
        if self.ignores_cost:
            return list(likely)
        enough = share * self.tolerance.cost
        costs = [free_running_cost(h, current, self.log, self.scale) for h in likely]
        good = [h for h, cost in zip(likely, costs, strict=True) if cost > enough]
        worse = [h for h, cost in zip(likely, costs, strict=True) if cost < -enough]
        contradicted = good and any(h.evidence > good[0].evidence + ODDS for h in worse)
        return [] if contradicted else good

    def _takes_up(self, further: Hypothesis, chosen: Sequence[str]) -> bool:
        """Whether a further effect only takes up what the shape of an earlier one gets wrong.

        Where thrust ahead and astern follow curves of another shape, a mean force is left beside the asymmetry that is
        named: an effect that the catalogue knows to be confused with an earlier one, and beside which measured inputs
        still predict the force, is no further cause.
        """
        law = further.estimate.law
        if law is None or not any(confused(further.name, name) for name in chosen):
            return False
        predicted = predicted_by_inputs(further.weighed, replace(self.windows, law=law))
        return predicted is not None and predicted.matters

    def _fitted(
        self, tested: Tested, current: Hypothesis, base: list[str], chosen: list[str],
        fitted: Sequence[FittedHypothesis], odds: float,
    ) -> list[Hypothesis]:  # fmt: skip
        """Return the leading effects, fitted and judged, the most evident first."""
        leading = self._leading(tested, current, base, chosen, fitted, WORTH_A_FIT * odds)
        found = self._all_judged(leading, current)
        rivals = () if chosen else rivals_of(found, tested.scores, ALPHA_NAME)
        more = [self._one(n, tested.scores[n], tested.at, current, base, chosen) for n in rivals]
        return sorted([*found, *self._all_judged([e for e in more if e], current)], key=lambda h: -h.evidence)

    def _all_judged(self, explanations: Sequence[FittedHypothesis], current: Hypothesis) -> list[Hypothesis]:
        law, found = current.estimate.law, []
        assert law is not None
        for explanation in explanations:
            # One whose free running grows so that nothing can be said of it is passed over.
            with suppress(*UNSOLVED):
                found.append(self.judged(explanation, law))
        return found

    def _leading(
        self,
        tested: Tested,
        current: Hypothesis,
        base: list[str],
        chosen: list[str],
        fitted: Sequence[FittedHypothesis],
        odds: float,
    ) -> list[FittedHypothesis]:
        """Return the leading effects fitted in full beside what was chosen, one explanation for each."""
        scores = {n: s for n, s in tested.scores.items() if s.degrees}
        known: dict[str, FittedHypothesis] = {}
        if not chosen:
            for e in fitted:
                name = e.effects[-1]
                if name in scores and (name not in known or e.fitted.cost < known[name].fitted.cost):
                    known[name] = e
        order = sorted(scores, key=lambda n: -scores[n].evidence)[:LEADERS]
        by_gain = sorted(scores, key=lambda n: scores[n].degrees - scores[n].gain)[:1]
        for name in dict.fromkeys([*order, *by_gain]):
            # A further name must bring much: what promises a small part of that is not worth a fit.
            if name not in known and (not chosen or 0.5 * scores[name].gain > odds):
                found = self._one(name, scores[name], tested.at, current, base, chosen)
                if found is not None:
                    known[name] = found
        return list(known.values())

    def _one(
        self, name: str, score: Score, at: Layout, current: Hypothesis, base: list[str], chosen: list[str]
    ) -> FittedHypothesis | None:
        """Return an effect fitted from what its test estimates, or from nearer its null; None where every fit fails.

        One that ends with larger errors than there are without it began too far off.
        """
        self.say(f"fitting {name} together with the force")
        known, start = parameters_of(at.model, [name]), initial_guess(self.layout, name, score.estimate)
        shape, found = shapes(self.layout, name), []
        for share in (1.0, 0.1):
            guess = at.model.rebuilt(at.model.copied_effects())
            set_parameters(guess, [name], np.where(shape, start, known + share * (start - known)))
            with suppress(FitError):
                found.append(
                    fit_hypothesis(
                        self.layout, self.windows, base, [*chosen, name], start=current.explanation.fitted,
                        guess=replace(at, model=guess), sigma=self.weights, iterations=STEPS,
                    )
                )  # fmt: skip
                if found[-1].squared_error(self.weights) <= current.explanation.squared_error(self.weights):
                    break
        return min(found, key=lambda e: e.squared_error(self.weights), default=None)
