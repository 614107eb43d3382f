"""Backward: effects that were taken before must still be needed once another is there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis, log_evidence
from auvnn.diagnosis.hypotheses.stated_priors import Layout, shapes
from auvnn.diagnosis.score_tests.variance_inflation import variance_inflation
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.selection.predictive_density import improves_predictive_density
from auvnn.effects import effect_class
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import set_parameters
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Logarithm of the odds beyond which nobody asks whether an effect is needed.
BEYOND_DOUBT = 300.0


@dataclass(frozen=True)
class Pruning:
    """Asks of what was taken whether it is still needed.

    Attributes:
        layout: stated values.
        windows: of the log.
        say: called with what is being done, in words.
    """

    layout: Layout

    windows: Windows

    say: Callable[[str], None]

    def _settled(self, best: FittedHypothesis, at: Layout, base: Sequence[str]) -> FittedHypothesis:
        """Return an explanation refitted with the weights that follow from the errors that it leaves."""
        guess = replace(at, model=best.fitted.model)
        try:
            return fit_hypothesis(
                self.layout, self.windows, base, best.effects, start=best.fitted, guess=guess
            )
        except FitError:
            return best

    def withdrawn(self, taken: FittedHypothesis, base: Sequence[str]) -> tuple[FittedHypothesis, list[str]]:
        """Return the explanation without those effects that it no longer needs, and their names.

        An effect that was taken first may have stood in for the ones that came after it. It goes where the
        evidence is no lower without it, or where it does not pay on runs left out, everything else refitted. Where it
        contains another one of the names, as a lift does a Munk moment, the evidence must be higher with it by the odds
        that a new name needs.

        Args:
            taken: the explanation, the newest effect last.
            base: effects that are free whatever is chosen.
        """
        gone: list[str] = []
        for name in taken.effects[:-1]:
            # What is uncertain anyway stays free without it, near what was stated: that takes a fit.
            if name not in base and self.clearly_needed(taken, name):
                continue
            left = tuple(e for e in taken.effects if e != name)
            self.say(f"asking whether {name} is still needed")
            model = taken.fitted.model.rebuilt(taken.fitted.model.copied_effects())
            set_parameters(model, [name], self.layout.means[name])
            try:
                without = fit_hypothesis(
                    self.layout,
                    self.windows,
                    base,
                    left,
                    start=taken.fitted,
                    guess=replace(self.layout, model=model),
                    sigma=taken.fitted.sigma,
                    iterations=6,
                )
            except FitError:
                # What cannot be fitted without it needs it.
                continue
            factor = self._factor(taken)
            least = ODDS if {*effect_class(name).contains} & {*left} else 0.0
            needed = (
                log_evidence(self.layout, taken, factor).evidence
                > log_evidence(self.layout, without, factor).evidence + least
            )
            if not needed or not improves_predictive_density(taken, without):
                gone.append(name)
                taken = self._settled(without, self.layout, base)
        return taken, gone

    def clearly_needed(self, taken: FittedHypothesis, name: str) -> bool:
        """Whether the evidence for an effect is beyond doubt without a fit in which it is absent.

        With W = J^T J and the other parameters following, the error grows by d^T (W_dd - W_do W_oo^-1 W_od) d on the way
        d to the effect's null: Wald's statistic. Where half of it is many times what any comparison asks for, a fit
        that is not linear decides no differently.

        Args:
            taken: the explanation.
            name: one of its effects.
        """
        fitted, place = taken.fitted, self.layout.places(taken.names)[name]
        # A shape says nothing where the effect is absent: it follows like the others.
        own = np.asarray(place)[~shapes(self.layout, name)]
        if not len(own):
            return False
        others = np.setdiff1d(np.arange(len(fitted.theta)), own)
        whole = fitted.statistics.total + fitted.priors.square
        left = NormalEquations(whole, fitted.statistics.slope.sum(0)).eliminate(own, others, rcond=1e-12)
        way = fitted.theta[own] - self.layout.means[name][~shapes(self.layout, name)]
        return bool(way @ left.information @ way > 2.0 * BEYOND_DOUBT * self._factor(taken))

    def without(
        self,
        taken: FittedHypothesis,
        base: Sequence[str],
        names: Sequence[str],
        sigma: Array | None = None,
        steps: int = 15,
    ) -> FittedHypothesis:
        """Return the explanation refitted without some of its effects.

        Args:
            taken: the explanation.
            base: effects that are free whatever is chosen.
            names: effects to do without.
            sigma: weights to keep, so that the two can be compared; those that follow from the errors by default.
            steps: of the fit; more while each takes a hundredth off the squared error.
        """
        model = taken.fitted.model.rebuilt(taken.fitted.model.copied_effects())
        for name in names:
            set_parameters(model, [name], self.layout.means[name])
        left = tuple(e for e in taken.effects if e not in names)
        guess = replace(self.layout, model=model)
        return fit_hypothesis(
            self.layout,
            self.windows,
            base,
            left,
            start=taken.fitted,
            guess=guess,
            sigma=sigma,
            iterations=steps,
        )

    def _without(
        self, after: FittedHypothesis, base: list[str], current: FittedHypothesis
    ) -> FittedHypothesis:
        """Return the same model without the effect, everything else refitted.

        Where the effect is a coefficient group that is uncertain anyway, that group stays as stated.
        """
        effect = after.effects[-1]
        if effect not in base:
            return current
        try:
            return fit_hypothesis(
                self.layout,
                self.windows,
                [n for n in base if n != effect],
                after.effects[:-1],
                start=current.fitted,
                sigma=current.fitted.sigma,
                iterations=6,
            )
        except FitError:
            return current

    @staticmethod
    def _factor(explanation: FittedHypothesis) -> float:
        sums = explanation.fitted.statistics
        return variance_inflation(sums.slope, sums.total, sums.run)
