"""Fits under a law of the stochastic force: steps of Gauss and Newton on the marginal likelihood.

A fit of output errors takes a large force for something that the parameters should explain: under a controller, whose
commands answer the force, it drives coefficients to the ends of their ranges, and effects away from their values. A
name is therefore fitted under the law as well, from where nothing is yet assumed of it. Each step linearises the
windows, integrates forces and initial states out, and goes where the likelihood that is then expected is largest; it is
kept only if the likelihood at the new values is larger. Where no step is left, the law is estimated again, and so on
until that changes little.

Reference: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, folds, left_out, plausible
from auvnn.diagnosis.hypotheses.standard_errors import of_timing
from auvnn.diagnosis.hypotheses.stated_priors import Layout, priors
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.noise_law.likelihood.about_motion import linear_about_its_own
from auvnn.estimation.prediction_error import SINGULAR, FitError
from auvnn.estimation.priors import limits, parameters_of, set_parameters
from auvnn.estimation.trajectories.initial_states import fit_initial_states
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# From an explanation, a law, and whether the law is held, to the hypothesis.
Judge = Callable[[FittedHypothesis, ForceLaw, bool], Hypothesis]
# What is raised where free running grows without bound, and sums of it cannot be solved.
UNSOLVED = (FitError, np.linalg.LinAlgError, SINGULAR)
# At most so many steps, the shares of a step that are tried, and the gain of the log likelihood that ends a fit.
STEPS, SHARES, SETTLED = 12, (1.0, 0.3, 0.1), 1.0
# Rounds of steps, the law estimated again between them.
ROUNDS = 4
# Values that are answered go on to where a step gains less than this, a tenth of a standard error; and steps at most.
CLOSE, LAST = 0.005, 4


class LawFits:
    """Fits under laws of the force, of one log.

    Args:
        windows: of the log, without a law.
        weights: (18,) by which errors count in fits without the force.
        judge: from an explanation and a law to the hypothesis with the law that is most likely with it, or with that law
            where it is held.
    """

    def __init__(self, windows: Windows, weights: Array, judge: Judge) -> None:
        """Keep what all fits share."""
        self.windows, self.weights, self.judge = windows, weights, judge

    def from_null(
        self,
        layout: Layout,
        model: GreyBox,
        current: Hypothesis,
        base: list[str],
        effects: list[str],
        least: float = -np.inf,
        *,
        held: bool = True,
    ) -> Hypothesis:
        """Return effects fitted under the law, from the values that a model has.

        Args:
            layout: stated values.
            model: with the values to begin from; of what is asked for, its null or near it.
            current: another explanation, whose law and trajectories to begin from.
            base: effects that are free anyway.
            effects: effects asked for.
            least: evidence below which, what steps promise included, the fit is given up.
            held: whether the first steps are taken under that law; else it is estimated again before the first step.
        """
        assert current.estimate.law is not None
        names = tuple(dict.fromkeys([*base, *effects]))
        stated = priors(layout, names, free=effects)
        begun = replace(current.explanation.fitted, names=names, priors=stated, model=model)
        begun = replace(begun, theta=parameters_of(model, names))
        timing = of_timing(model, names, self.windows)
        explanation = FittedHypothesis(
            tuple(effects), begun, names, 0.0, np.zeros(0), np.zeros(0), systematic=timing
        )
        judged = plausible(layout, names, effects, stated, begun.theta)
        started = replace(explanation, judged=judged, around=current.explanation.around)
        return self.settled(self.judge(started, current.estimate.law, held), least=least)

    def settled(self, found: Hypothesis, most: int = STEPS, least: float = -np.inf) -> Hypothesis:
        """Return a hypothesis at parameters where its likelihood is largest, as far as steps lead there.

        Its evidence is that of the parameters at which it ends: what a further step only promises does not count.

        Args:
            found: to begin from.
            most: steps, under all laws together.
            least: evidence below which, what a step promises included, it is given up.
        """
        best = found
        for turn in range(ROUNDS):
            stuck = False
            while most > 0 and found.evidence > least and 0.5 * found.promised >= SETTLED:
                again = self._step(found)
                if again is None:
                    stuck = True
                    break
                most -= 1
                found, little = again, _here(again) - _here(found) < SETTLED
                if little:
                    break
            best = found if _here(found) > _here(best) else best
            law = found.estimate.law
            if found.evidence <= least or law is None or turn == ROUNDS - 1:
                break
            smoothed = None if found.explanation.around is not None else self._smoothed(found)
            if smoothed is None:
                again = self.judge(found.explanation, law, False)
                # The likeliest law is that of what a step promises, and worth what is left of that once it was taken.
                # Where no share of the step brought anything, it must promise more by the new law than by the old one.
                better = again.evidence - (found.evidence if stuck else _here(found)) >= SETTLED
                found = again if better else found
                if better and turn < ROUNDS - 2:
                    continue
                # Trajectories hardly change while the law does: they are looked at where nothing else changes any more.
                smoothed = self._smoothed(found)
                if smoothed is None and not better:
                    break
            if smoothed is not None:
                # What is linear about other trajectories is the nearer to the truth, and not to be compared.
                best = found = self.judge(smoothed, found.estimate.law or law, True)
        return best if 0.5 * best.promised < SETTLED else best.here

    def closer(self, found: Hypothesis) -> Hypothesis:
        """Return a hypothesis at the values that are likeliest by its law.

        Where explanations are compared, a unit of the log likelihood decides nothing, and steps end there: at up to 1.4
        standard errors from the likeliest values, which is far for values that are answered.

        Args:
            found: where steps have led.
        """
        for _ in range(LAST):
            if 0.5 * found.promised < CLOSE:
                break
            again = self._step(found)
            if again is None:
                break
            found = again
        return found

    def _step(self, found: Hypothesis) -> Hypothesis | None:
        """Return the hypothesis a step on; None where no share of the step makes it likelier."""
        law, explanation = found.estimate.law, found.explanation
        fitted = explanation.fitted
        assert law is not None
        low, high = limits(fitted.model, explanation.names, fitted.priors)
        for share in SHARES:
            theta = np.clip(fitted.theta + share * found.estimate.step, low, high)
            with suppress(*UNSOLVED):
                again = self.judge(self._at(explanation, theta), law, True)
                if _here(again) > _here(found):
                    return again
        return None

    def _at(self, found: FittedHypothesis, theta: Array) -> FittedHypothesis:
        """Return an explanation at other values; its sums without a force are not worked out there, see `told`."""
        model = found.fitted.model.rebuilt(found.fitted.model.copied_effects())
        set_parameters(model, found.names, theta)
        return replace(found, fitted=replace(found.fitted, model=model, theta=theta))

    def _smoothed(self, found: Hypothesis) -> FittedHypothesis | None:
        """Return an explanation linear about its own likeliest trajectories; None where these are where they were.

        Args:
            found: the explanation, with its law.
        """
        explanation = found.explanation
        with suppress(*UNSOLVED):
            return linear_about_its_own(explanation, self.windows, found.estimate, found.weighed.fitted.sigma)
        return None

    def told(self, found: FittedHypothesis) -> FittedHypothesis:
        """Return an explanation with initial states, sums and errors on what is left out, all of free running.

        Args:
            found: fitted under a law.
        """
        fitted, judged_by = found.fitted, found.judged or found.fitted.priors
        free = fitted.model.without_absent(found.names)
        initial = fit_initial_states(free, self.windows, self.weights, fitted.initial)
        sums, _, _ = normal_equations(
            self.windows, linearise(fitted.model, self.windows, initial, found.names), self.weights
        )
        cost = float(sums.cost.sum()) + fitted.priors.penalty(fitted.theta)
        own = left_out(sums, fitted.theta, judged_by, folds(self.windows.run))
        count = sums.count[:, np.isfinite(self.weights)].sum(1)
        whole = replace(
            fitted, initial=initial, sigma=self.weights, statistics=sums, cost=cost, converged=True
        )
        return replace(found, fitted=whole, left_out=own, left_out_count=count)


def _here(found: Hypothesis) -> float:
    """Return the evidence without what a further step promises."""
    return found.here.evidence
