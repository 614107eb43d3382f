"""Between which explanations a log decides: by how well they fit, and by how much they could have explained."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis, log_evidence
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.effects import effect_class
from auvnn.effects.acting_beside import last_names
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.metrics.windows import Windows

# Odds of a hundred to one: below that two explanations are not told apart. Several of them compete in every log, and
# at twenty to one a wrong one wins now and then by chance.
ODDS = float(np.log(100.0))
# How unlikely it must be that an explanation is right and the better fit of one with more parameters chance; and from
# where on the first is needed beside the second. Evidence weighs how large parameters might have been, which is a
# guess: it must not give a name to what the data refute.
ALPHA_REFUTED, ALPHA_NEEDED = 0.001, 0.01


@dataclass(frozen=True)
class ModelComparison:
    """Compares explanations of one log, each by its last effect.

    Attributes:
        layout: stated values.
        windows: of the log.
        say: called with what is being done, in words.
    """

    layout: Layout
    windows: Windows
    say: Callable[[str], None]

    def standing(
        self, paying: list[FittedHypothesis], at: Layout, base: list[str], factor: float
    ) -> tuple[FittedHypothesis, list[FittedHypothesis]]:
        """Return the explanation to take, and the others that it does not refute.

        Args:
            paying: by falling evidence.
            at: the layout at the fit without any of them.
            base: effects that are free anyway.
            factor: as in `weigh`.
        """
        best, refuted = paying[0], []
        for other in paying[1:]:
            if self._refutes(other, best, at, base, factor):
                refuted.append(best)
                best = other
        standing = [e for e in paying if e is not best and not any(e is r for r in refuted)]
        # Those that are far behind by evidence are told apart anyway.
        near = [e for e in standing if best.evidence - e.evidence < ODDS]
        refuted += [e for e in near if self._refutes(best, e, at, base, factor)]
        return best, [e for e in standing if not any(e is r for r in refuted)]

    def _size(self, explanation: FittedHypothesis) -> int:
        """Return how many parameters the last effect of an explanation has, with what acts beside it only."""
        return len(self.layout.of(last_names(explanation.effects)))

    def _refutes(
        self, other: FittedHypothesis, best: FittedHypothesis, at: Layout, base: list[str], factor: float
    ) -> bool:
        """Whether one explanation fits better than chance allows if another one were right, and needs no help of it.

        Were the other one right, the parameters of the first would gain what chi-squared allows beside it, and less
        alone. Where each is needed beside the other, neither is the whole cause, and evidence says which comes first.
        """
        extra = self._size(other)
        if best.misfit - other.misfit <= chi2.isf(ALPHA_REFUTED, extra):
            return False
        try:
            both = log_evidence(self.layout, self.together(other, best, at, base), factor)
        except FitError:
            return False
        own = self._size(best)
        return bool(other.misfit - both.misfit < chi2.isf(ALPHA_NEEDED, own))

    def told_apart(self, best: FittedHypothesis, other: FittedHypothesis) -> bool:
        """Whether the log decides between two explanations.

        The evidence also counts how many parameters there are and how large they might have been. Where the fit
        is the same, that settles it only against the one with more parameters, and not where it is the plainer.
        """
        if best.evidence - other.evidence < ODDS:
            return False
        if 0.5 * (other.misfit - best.misfit) >= ODDS:
            return True
        mine, theirs = best.effects[-1], other.effects[-1]
        return self._size(other) > self._size(best) and theirs not in effect_class(mine).plainer

    def together(
        self, best: FittedHypothesis, other: FittedHypothesis, at: Layout, base: list[str]
    ) -> FittedHypothesis:
        """Return the fit of two explanations as one, the errors weighed as in the first's.

        Args:
            best: an explanation; its last effect is the one in question.
            other: another one, likewise.
            at: the layout at the current fit.
            base: effects that are free anyway.
        """
        self.say(f"fitting {best.effects[-1]} and {other.effects[-1]} together")
        guess = at.model.rebuilt(at.model.copied_effects())
        for each in (best, other):
            names = last_names(each.effects)
            set_parameters(guess, names, parameters_of(each.fitted.model, names))
        more = [n for n in last_names(other.effects) if n not in best.effects]
        return fit_hypothesis(
            self.layout,
            self.windows,
            base,
            (*best.effects, *more),
            start=best.fitted,
            guess=replace(at, model=guess),
            sigma=best.fitted.sigma,
            iterations=6,
        )


def confused(one: str, other: str) -> bool:
    """Whether the catalogue knows that one effect is confused with the other."""
    return other in effect_class(one).confused_with or one in effect_class(other).confused_with


def forms_that_leave(name: str, earlier: Iterable[str]) -> list[str]:
    """Return those earlier effects of which the catalogue knows that what their form gets wrong looks like an effect.

    Args:
        name: the effect.
        earlier: effects found before.
    """
    return [n for n in earlier if name in effect_class(n).leaves]
