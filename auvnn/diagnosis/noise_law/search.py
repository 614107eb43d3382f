"""Names beside a stochastic force: explanations are compared again, each with the law of the force that is likely with it.

Where no force is left, nothing here is asked and the answer is that of the search without one. Else the law of the
force is estimated at the fit without any name. An effect that is absent from the model inflates the variance that then
hides it: those that lead with the variance at zero, which the first search has fitted in full, are therefore compared
with those that lead under the law. Each explanation is judged by its marginal likelihood at its own law, forces and
initial states integrated out and its parameters following the law, and by how well it foresees runs left out.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.layout import Layout, initial_guess, shapes
from auvnn.diagnosis.noise_law.hypothesis import BesideForce, Hypothesis, judged, p_value_of, tied
from auvnn.diagnosis.noise_law.law import estimate
from auvnn.diagnosis.noise_law.sums import CELL, force_sums
from auvnn.diagnosis.score_tests.null_tests import NullTests, Tested
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.choose import ALPHA
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.selection.predictive_density import cross_validated_log_density
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.metrics.force_law import ForceLaw, cell_for
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# A name is given where chance would seldom do as well among all effects that were asked for; a further one on
# stronger grounds, because each time chance gets another turn.
ALPHA_NAME, ALPHA_FURTHER = 0.01, 0.001
# Standard errors by which runs left out must be foreseen better.
GAIN, GAIN_FURTHER = 1.0, 2.0
# Fitted in full beside those that the first search has fitted: so many of those that lead under the law.
LEADERS = 3
# Members of a group that the log cannot tell apart, at most.
GROUP = 3
STEPS = 6


class ForceSearch:
    """The search beside a stochastic force, of one log.

    Args:
        layout: stated values.
        windows: of the log, without a law.
        usable: effects that can be asked for.
        base: effects that are free anyway.
        say: told in words what is being done.
    """

    def __init__(
        self,
        layout: Layout,
        windows: Windows,
        usable: Sequence[str],
        base: Sequence[str],
        say: Callable[[str], None],
    ) -> None:
        """Begin without a law."""
        self.layout, self.windows, self.usable, self.base = layout, windows, list(usable), list(base)
        self.say = say
        self.sigma = np.full(18, np.inf)
        self.cell = CELL

    def begin(self, first: FittedHypothesis, sigma: Array) -> Hypothesis | None:
        """Return the explanation without any name under the law of the force; None where no variance is above zero.

        Args:
            first: the fit without any effect.
            sigma: (18,) the sensors' white noise.
        """
        self.say("estimating the law of the force that is left")
        self.sigma = sigma
        found = estimate(force_sums(first, self.windows, sigma, self.cell))
        if found.law is None:
            return None
        cell = cell_for(found.law.time[found.law.axes])
        if cell < self.cell:
            self.cell = cell
            found = estimate(force_sums(first, self.windows, sigma, cell), replace(found.law, cell=cell), found.law.axes)
        assert found.law is not None
        return self.judged(first, found.law)

    def judged(self, explanation: FittedHypothesis, law: ForceLaw) -> Hypothesis:
        """Return an explanation with the law that is most likely with it, and what they are worth."""
        return judged(
            self.layout, explanation, force_sums(explanation, self.windows, self.sigma, self.cell), law
        )

    def run(self, null: Hypothesis, fitted: Sequence[FittedHypothesis], most: int) -> BesideForce:
        """Search for one effect after the other.

        Args:
            null: from `begin`.
            fitted: explanations of one effect that the first search has fitted.
            most: look for at most this many.
        """
        current, chosen = null, []
        steps: list[dict[str, Any]] = []
        groups: list[list[str]] = []
        tried: list[Hypothesis] = []
        whole = 1.0
        while len(chosen) < most:
            law = current.estimate.law
            assert law is not None
            grouped = {m for g in groups for m in g}
            remaining = [n for n in self.usable if n not in chosen and n not in grouped]
            if not remaining:
                break
            self.say(f"testing {len(remaining)} effects beside the force")
            base = [*self.base, *[c for c in chosen if c not in self.base]]
            tested = NullTests(self.layout, replace(self.windows, law=law), self.say)(
                current.explanation, remaining, base, chosen
            )
            # Beside what was found the variance is no longer inflated by it: the tests say whether to go on.
            if chosen and tested.p_value >= ALPHA:
                break
            leading = self._leading(tested, current, base, chosen, fitted)
            found = [self.judged(e, law) for e in leading]
            found.sort(key=lambda h: -h.evidence)
            sure = {h.name: min(1.0, len(remaining) * p_value_of(self.layout, h, current)) for h in found}
            if not chosen:
                tried = found
                whole = min([tested.p_value, *sure.values()], default=1.0)
            level, least = (ALPHA_FURTHER, GAIN_FURTHER) if chosen else (ALPHA_NAME, GAIN)
            good = [
                h
                for h in found
                if h.evidence > current.evidence + ODDS
                and sure[h.name] < level
                and foresees(h, current, least)
            ]
            if not good:
                break
            group = tied(self.layout, good)
            if len(group) > GROUP:
                break
            names = [h.name for h in group]
            verdict = "ambiguous" if len(group) > 1 else "named"
            steps.append({"verdict": verdict, "effects": names, "p_value": sure[group[0].name]})
            if len(group) > 1:
                groups.append(names)
            current = self._taken(group[0])
            chosen.append(group[0].name)
        law = current.estimate.law
        assert law is not None
        return BesideForce(
            steps,
            groups,
            current.explanation,
            replace(self.windows, law=law),
            current.estimate,
            [h.explanation for h in tried],
            whole,
            null.explanation,
            null.estimate.law,
        )

    def _leading(
        self,
        tested: Tested,
        current: Hypothesis,
        base: list[str],
        chosen: list[str],
        fitted: Sequence[FittedHypothesis],
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
            if name not in known:
                found = self._one(name, scores[name], tested.at, current, base, chosen)
                if found is not None:
                    known[name] = found
        return list(known.values())

    def _one(
        self, name: str, score: Score, at: Layout, current: Hypothesis, base: list[str], chosen: list[str]
    ) -> FittedHypothesis | None:
        """Return an effect fitted from what its test estimates, or from nearer its null; None where every fit fails."""
        self.say(f"fitting {name} beside the force")
        law = current.estimate.law
        assert law is not None
        under = replace(self.windows, law=law)
        known, start = parameters_of(at.model, [name]), initial_guess(self.layout, name, score.estimate)
        shape = shapes(self.layout, name)
        for share in (1.0, 0.1):
            guess = at.model.rebuilt(at.model.copied_effects())
            set_parameters(guess, [name], np.where(shape, start, known + share * (start - known)))
            try:
                return fit_hypothesis(
                    self.layout, under, base, [*chosen, name], start=current.explanation.fitted,
                    guess=replace(at, model=guess), sigma=self.sigma, iterations=STEPS,
                )  # fmt: skip
            except FitError:
                continue
        return None

    def _taken(self, best: Hypothesis) -> Hypothesis:
        """Return a hypothesis fitted under its own law."""
        law = best.estimate.law
        assert law is not None
        found = best.explanation
        again = fit_hypothesis(
            self.layout, replace(self.windows, law=law), self.base, found.effects,
            start=found.fitted, guess=replace(self.layout, model=found.fitted.model), sigma=self.sigma, iterations=STEPS,
        )  # fmt: skip
        return self.judged(again, law)


def foresees(after: Hypothesis, before: Hypothesis, least: float) -> bool:
    """Whether runs left out are foreseen better, by so many standard errors of the gain."""
    gain = cross_validated_log_density(before.weighed) - cross_validated_log_density(after.weighed)
    return float(gain.sum()) > least * float(np.sqrt(len(gain)) * gain.std(ddof=1))
