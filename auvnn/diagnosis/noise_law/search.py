"""Names beside a stochastic force: the search goes on where a force is left that no name explains.

Where no force is left, nothing here is asked and the answer is that of the search without one. Else the law of the
force is estimated at the fit without any name (`noise_law`), and the effects are asked for again with the windows'
errors weighed by it. An effect that is absent from the model inflates the variance that then hides it: those that lead
with the variance at zero are therefore fitted too, and every explanation is judged by its marginal likelihood at the
law that is most likely with it.

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
from auvnn.diagnosis.selection.predictive_density import improves_predictive_density
from auvnn.estimation.normal_equations import linearise, normal_equations, residual_std
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.metrics.force_law import ForceLaw, cell_for
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# A name is given where chance would seldom do as well among all effects that were asked for.
ALPHA_NAME = 0.01
# Fitted in full: so many of those that lead with the force's variance, and with it at zero; and so many are judged by
# laws of their own.
LEADERS, WITHOUT, JUDGED = 4, 2, 3
# Members of a group that the log cannot tell apart, at most.
GROUP = 3
STEPS = 4


class ForceSearch:
    """The search beside a stochastic force, of one log.

    Args:
        layout: stated values.
        windows: of the log, without a law.
        usable: effects that can be asked for.
        base: effects that are free anyway.
        floor: (18,) below which no channel is trusted.
        say: told in words what is being done.
    """

    def __init__(
        self,
        layout: Layout,
        windows: Windows,
        usable: Sequence[str],
        base: Sequence[str],
        floor: Array,
        say: Callable[[str], None],
    ) -> None:
        """Begin without a law."""
        self.layout, self.windows, self.usable, self.base = layout, windows, list(usable), list(base)
        self.floor, self.say = floor, say
        self.sigma = np.full(18, np.inf)
        self.cell = CELL

    def begin(self, first: FittedHypothesis, sigma: Array) -> Hypothesis | None:
        """Return the explanation without any name under the law of the force; None where no variance is above zero.

        Args:
            first: the fit without any effect.
            sigma: (18,) the sensors' white noise.
        """
        self.say("estimating the law of the force that is left")
        found = estimate(force_sums(first, self.windows, sigma, self.cell))
        if found.law is None:
            return None
        self.cell = cell_for(found.law.time[found.law.axes])
        first = self._again(first, found.law, sigma)
        under = replace(self.windows, law=found.law)
        sums, _, _ = normal_equations(
            under,
            linearise(first.fitted.model, under, first.fitted.initial, first.names),
            sigma,
            leverage=True,
        )
        self.sigma = np.where(
            np.isfinite(sigma), residual_std(sums, self.floor, len(first.fitted.theta)), np.inf
        )
        found = estimate(force_sums(first, self.windows, self.sigma, self.cell))
        if found.law is None:
            return None
        return self.judged(self._again(first, found.law, self.sigma), found.law)

    def _again(self, found: FittedHypothesis, law: ForceLaw, sigma: Array) -> FittedHypothesis:
        """Return an explanation fitted under a law."""
        return fit_hypothesis(
            self.layout, replace(self.windows, law=replace(law, cell=self.cell)), self.base, found.effects,
            start=found.fitted, guess=replace(self.layout, model=found.fitted.model), sigma=sigma, iterations=STEPS,
        )  # fmt: skip

    def judged(self, explanation: FittedHypothesis, law: ForceLaw) -> Hypothesis:
        """Return an explanation with the law that is most likely with it, and what they are worth."""
        return judged(
            self.layout, explanation, force_sums(explanation, self.windows, self.sigma, law.cell), law
        )

    def run(self, null: Hypothesis, leading: Sequence[str], most: int) -> BesideForce:
        """Search for one effect after the other.

        Args:
            null: from `begin`.
            leading: effects that lead with the variance at zero, the first first.
            most: look for at most this many.
        """
        current, chosen = null, []
        steps: list[dict[str, Any]] = []
        groups: list[list[str]] = []
        tried: list[FittedHypothesis] = []
        whole = 1.0
        while True:
            law = current.estimate.law
            assert law is not None
            under = replace(self.windows, law=law)
            grouped = {m for g in groups for m in g}
            remaining = [n for n in self.usable if n not in chosen and n not in grouped]
            if not remaining or len(chosen) >= most:
                break
            self.say(f"testing {len(remaining)} effects beside the force")
            base = [*self.base, *[c for c in chosen if c not in self.base]]
            tested = NullTests(self.layout, under, self.say)(current.explanation, remaining, base, chosen)
            # Beside what was found the variance is no longer inflated by it: the tests say whether to go on.
            if chosen and tested.p_value >= ALPHA:
                break
            fitted = self._fitted(tested, under, current, base, chosen, leading if not chosen else ())
            if not chosen:
                tried = fitted
            found = [self.judged(e, law) for e in fitted[:JUDGED]]
            found.sort(key=lambda h: -h.evidence)
            sure = {h.name: min(1.0, len(remaining) * p_value_of(self.layout, h, current)) for h in found}
            if not chosen:
                whole = min([tested.p_value, *sure.values()], default=1.0)
            good = [
                h
                for h in found
                if h.evidence > current.evidence + ODDS
                and sure[h.name] < ALPHA_NAME
                and improves_predictive_density(h.explanation, self._without(h, current, under))
            ]
            if not good:
                break
            best, group = good[0], tied(self.layout, good)
            if len(group) > GROUP:
                break
            names = [h.name for h in group]
            steps.append(
                {
                    "verdict": "ambiguous" if len(group) > 1 else "named",
                    "effects": names,
                    "p_value": sure[best.name],
                }
            )
            if len(group) > 1:
                groups.append(names)
            current = self._taken(group[0])
            chosen.append(group[0].name)
        current, steps, groups = self._needed(current, steps, groups)
        law = current.estimate.law
        assert law is not None
        return BesideForce(
            steps,
            groups,
            current.explanation,
            replace(self.windows, law=law),
            current.estimate,
            tried,
            whole,
            null.explanation,
            null.estimate.law,
        )

    def _fitted(
        self,
        tested: Tested,
        under: Windows,
        current: Hypothesis,
        base: list[str],
        chosen: list[str],
        leading: Sequence[str],
    ) -> list[FittedHypothesis]:
        """Return the leading effects fitted in full beside what was chosen, the smallest misfit first."""
        scores = {n: s for n, s in tested.scores.items() if s.degrees}
        order = sorted(scores, key=lambda n: -scores[n].evidence)[:LEADERS]
        by_gain = sorted(scores, key=lambda n: scores[n].degrees - scores[n].gain)[:2]
        names = dict.fromkeys([*order, *by_gain, *[n for n in leading if n in scores][:WITHOUT]])
        tried = [self._one(n, scores[n], tested.at, under, current, base, chosen) for n in names]
        fitted = [e for e in tried if e is not None]
        count = {e.effects[-1]: len(self.layout.columns[e.effects[-1]]) for e in fitted}
        return sorted(fitted, key=lambda e: e.fitted.cost + count[e.effects[-1]])

    def _one(
        self,
        name: str,
        score: Score,
        at: Layout,
        under: Windows,
        current: Hypothesis,
        base: list[str],
        chosen: list[str],
    ) -> FittedHypothesis | None:
        """Return an effect fitted from what its test estimates, or from nearer its null; None where every fit fails."""
        self.say(f"fitting {name} beside the force")
        known, start = parameters_of(at.model, [name]), initial_guess(self.layout, name, score.estimate)
        shape, best = shapes(self.layout, name), None
        for share in (1.0, 0.3, 0.05):
            guess = at.model.rebuilt(at.model.copied_effects())
            set_parameters(guess, [name], np.where(shape, start, known + share * (start - known)))
            try:
                found = fit_hypothesis(
                    self.layout, under, base, [*chosen, name], start=current.explanation.fitted,
                    guess=replace(at, model=guess), sigma=self.sigma, iterations=STEPS,
                )  # fmt: skip
            except FitError:
                continue
            if best is None or found.fitted.cost < best.fitted.cost:
                best = found
            if best.fitted.cost <= current.explanation.fitted.cost:
                break
        return best

    def _without(self, after: Hypothesis, current: Hypothesis, under: Windows) -> FittedHypothesis:
        """Return the fit without the effect that came last; a coefficient that is uncertain anyway stays as stated."""
        if after.name not in self.base:
            return current.explanation
        fitted = current.explanation.fitted
        return fit_hypothesis(
            self.layout, under, [n for n in self.base if n != after.name], after.explanation.effects[:-1],
            start=fitted, sigma=self.sigma, iterations=STEPS,
        )  # fmt: skip

    def _taken(self, best: Hypothesis) -> Hypothesis:
        """Return a hypothesis fitted under its own law."""
        law = best.estimate.law
        assert law is not None
        return self.judged(self._again(best.explanation, law, self.sigma), law)

    def _needed(
        self, current: Hypothesis, steps: list[dict[str, Any]], groups: list[list[str]]
    ) -> tuple[Hypothesis, list[dict[str, Any]], list[list[str]]]:
        """Withdraw what is no longer needed beside what came after it."""
        for name in current.explanation.effects[:-1]:
            self.say(f"asking whether {name} is still needed")
            law = current.estimate.law
            assert law is not None
            fitted = current.explanation.fitted
            model = fitted.model.rebuilt(fitted.model.copied_effects())
            set_parameters(model, [name], self.layout.means[name])
            left = tuple(e for e in current.explanation.effects if e != name)
            without = fit_hypothesis(
                self.layout, replace(self.windows, law=law), self.base, left, start=fitted,
                guess=replace(self.layout, model=model), sigma=self.sigma, iterations=STEPS,
            )  # fmt: skip
            other = self.judged(without, law)
            if other.evidence < current.evidence:
                continue
            current = other
            step = next(s for s in steps if name in s["effects"])
            groups = [g for g in groups if name not in g]
            steps = [
                *steps,
                {"verdict": "withdrawn", "effects": list(step["effects"]), "p_value": step["p_value"]},
            ]
        return current, steps, groups
