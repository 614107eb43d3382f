"""Which effect to take: the leading ones are refitted, weighed, and must pay on runs left out.

Forward, one effect at a time; and backward: what was taken before must still be needed once another is there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis, log_evidence
from auvnn.diagnosis.hypotheses.stated_priors import Layout, scales, shapes
from auvnn.diagnosis.hypotheses.within_record import within_record
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.selection.also_fitted import promising, rivals_to_fit
from auvnn.diagnosis.selection.model_comparison import ODDS, ModelComparison
from auvnn.diagnosis.selection.predictive_density import improves_predictive_density
from auvnn.diagnosis.selection.prune import Pruning
from auvnn.diagnosis.selection.refit_leaders import Beside, fitted_beside
from auvnn.diagnosis.selection.rivals import Rivals
from auvnn.effects import effect_class
from auvnn.effects.acting_beside import in_place_of
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.executors import Executor
from auvnn.executors.serial import SERIAL

Array = NDArray[np.float64]
ALPHA = 0.05
# Explanations are refitted in full, nonlinearly, as long as their one-step evidence is within reach of the best.
LEADERS, REACH, REACH_SHARE = 5, 30.0, 0.5
# What takes up what earlier names get wrong explains less than such a share of what these explain in the mean.
LITTLE = 0.5
# What the form of an effect gets wrong exerts less than so many times what the effect does.
FORM = 2.0
# Within this share of its plausible scale of its null, an effect does nothing.
NOTHING = 1e-4


@dataclass(frozen=True)
class Choice:
    """What the leading effects came to.

    Attributes:
        verdict: named, ambiguous or unknown.
        best: the explanation that is taken; None where none pays.
        tried: all that were refitted.
        rivals: where ambiguous, the explanations between which the log cannot decide; the first is the one taken.
        failed: effects whose fit failed, and why, in words.
    """

    verdict: str
    best: FittedHypothesis | None
    tried: list[FittedHypothesis]
    rivals: list[FittedHypothesis]
    failed: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Chooser(Pruning):
    """Weighs explanations of one log.

    Attributes:
        layout: stated values.
        windows: of the log.
        say: called with what is being done, in words.
        pool: who makes fits of which none has to wait for another.
    """

    pool: Executor = SERIAL

    @property
    def rivals(self) -> ModelComparison:
        """Who compares explanations."""
        return ModelComparison(self.layout, self.windows, self.say)

    def choose(
        self,
        scores: dict[str, Score],
        at: Layout,
        base: list[str],
        chosen: list[str],
        current: FittedHypothesis,
        places: float = math.inf,
    ) -> Choice:
        """Refit the leading effects beside those chosen before, and take the one that explains best.

        Args:
            scores: tests of the effects that remain.
            at: the layout at the current fit.
            base: effects that are free anyway.
            chosen: effects found before.
            current: the fit without any of those that remain.
            places: how many more names may be given.
        """
        significant = [s for s in scores.values() if s.degrees and s.p_value < ALPHA]
        leading = sorted(significant, key=lambda s: -s.evidence)[:LEADERS]
        top = leading[0].evidence if leading else 0.0
        leading = [s for s in leading if s.evidence > min(top - REACH, REACH_SHARE * top)]
        leading += promising(significant, leading)
        # Evidence counts an effect of many parameters low while it is small; a test that is clear even among
        # all the others lets it be judged by what it does on runs left out.
        clear = {s.effect for s in significant if s.p_value < ALPHA / len(scores)}
        beside = Beside(
            self.layout, self.windows, at, base, chosen, current, tuple(scores) if places > 1 else ()
        )
        tried, failed = fitted_beside(beside, leading, self.pool, self.say)
        more = rivals_to_fit(tried, significant, current)
        tried += fitted_beside(beside, more, self.pool, self.say)[0]
        found = self._among(tried, clear, at, base, current)
        return replace(found, failed=failed)

    def _among(
        self,
        tried: list[FittedHypothesis],
        clear: set[str],
        at: Layout,
        base: list[str],
        current: FittedHypothesis,
    ) -> Choice:
        """Weigh explanations that have been fitted, and take the one that explains best."""
        if not tried:
            return Choice("unknown", None, [], [])
        factor = min(self._factor(e) for e in tried)
        current = log_evidence(self.layout, current, factor)
        tried = sorted((log_evidence(self.layout, e, factor) for e in tried), key=lambda e: -e.evidence)
        paying = [
            e
            for e in tried
            if (e.evidence > current.evidence or e.effects[-1] in clear)
            and improves_predictive_density(e, self._without(e, base, current))
        ]
        if not paying:
            return Choice("unknown", None, tried, [])
        best, standing = self.rivals.standing(paying, at, base, factor)
        rivals = [e for e in standing if not self.rivals.told_apart(best, e)]
        if rivals:
            for other in rivals:
                both = self._joined(best, other, at, base, factor)
                if both is not None:
                    return Choice("named", both, tried, [])
            plainer = effect_class(best.effects[-1]).plainer
            group = sorted([best, *rivals], key=lambda e: e.effects[-1] not in plainer)
            # The first stands for all of them while more is asked for.
            final = self._settled(group[0], at, base)
            if self._has_no_effect(final):
                return self._among([e for e in tried if e is not group[0]], clear, at, base, current)
            return Choice("ambiguous", final, tried, [final, *group[1:]])
        final = self._settled(best, at, base)
        if self._has_no_effect(final):
            return self._among([e for e in tried if e is not best], clear, at, base, current)
        return Choice("named", final, [final, *tried[1:]] if tried[0] is best else [final, *tried], [])

    def _has_no_effect(self, final: FittedHypothesis) -> bool:
        """Return whether a fit that has settled has taken the last effect to its null, or out of the log."""
        name = final.effects[-1]
        away = parameters_of(final.fitted.model, [name]) - self.layout.means[name]
        small = shapes(self.layout, name) | (np.abs(away) < NOTHING * scales(self.layout, name))
        return bool(small.all()) or not within_record(final, self.windows)

    def _instead(
        self, taken: FittedHypothesis, base: Sequence[str], name: str, other: FittedHypothesis
    ) -> FittedHypothesis:
        """Return an explanation refitted with the last effect of another one in the place of one of its own."""
        gone, new = in_place_of(name, taken.effects, other.effects)
        model = taken.fitted.model.rebuilt(taken.fitted.model.copied_effects())
        for effect in gone:
            set_parameters(model, [effect], self.layout.means[effect])
        set_parameters(model, new, parameters_of(other.fitted.model, new))
        return fit_hypothesis(
            self.layout,
            self.windows,
            base,
            (*(e for e in taken.effects if e not in (*gone, *new)), *new),
            start=taken.fitted,
            guess=replace(self.layout, model=model),
            sigma=taken.fitted.sigma,
            iterations=6,
        )

    def regrouped(
        self, taken: FittedHypothesis, base: Sequence[str], group: Sequence[FittedHypothesis]
    ) -> list[FittedHypothesis]:
        """Return a group between whose members the log still cannot decide, with all in it that was found after it.

        Args:
            taken: the explanation with the group's first and what came after it.
            base: effects that are free whatever is chosen.
            group: as it was found.

        Returns:
            explanations with the member in question last, the one to be taken first; one alone where the others are
            told apart from it now.
        """
        name = group[0].effects[-1]
        others = tuple(e for e in taken.effects if e != name)
        first = replace(taken, effects=(*others, name))
        members = [first]
        for other in group[1:]:
            # One that cannot be fitted beside what was found since is no rival any more.
            with suppress(FitError):
                members.append(self._instead(taken, base, name, other))
        factor = min(self._factor(e) for e in members)
        best, *more = sorted(
            (log_evidence(self.layout, e, factor) for e in members), key=lambda e: -e.evidence
        )
        left = [best, *(e for e in more if not self.rivals.told_apart(best, e))]
        plainer = effect_class(best.effects[-1]).plainer
        left.sort(key=lambda e: e.effects[-1] not in plainer)
        if left[0].effects[-1] == name:
            return left
        return [self._settled(left[0], self.layout, list(base)), *left[1:]]

    def in_place(
        self, taken: FittedHypothesis, base: Sequence[str], rivals: Rivals
    ) -> tuple[tuple[str, FittedHypothesis] | None, dict[str, list[FittedHypothesis]]]:
        """Compare an explanation with rivals in the place of its names, everything else refitted.

        Args:
            taken: the explanation with all names.
            base: effects that are free whatever is chosen.
            rivals: of names, explanations with each rival as the last effect.

        Returns:
            the name that has to give its place, and the explanation that takes it: more likely by the odds that a name
            needs, and better on what is left out; None where there is none. And by names those from which the log cannot
            tell them, the one to be taken first.
        """
        found: list[tuple[str, FittedHypothesis]] = []
        for name, rival in [(n, e) for n, of in rivals.items() for e in of]:
            with suppress(FitError, np.linalg.LinAlgError):
                found.append((name, self._instead(taken, base, name, rival)))
        factor = min(self._factor(e) for e in [taken, *(e for _, e in found)])
        taken = log_evidence(self.layout, taken, factor)
        weighed = [(name, log_evidence(self.layout, e, factor)) for name, e in found]
        better = [
            (name, e)
            for name, e in weighed
            if e.evidence - taken.evidence > ODDS and improves_predictive_density(e, taken)
        ]
        if better:
            name, best = max(better, key=lambda pair: pair[1].evidence)
            return (name, self._settled(best, self.layout, list(base))), {}
        groups: dict[str, list[FittedHypothesis]] = {}
        # A rival of two names is told once, with the one in whose place it explains most.
        nearest = {e.effects[-1]: n for n, e in sorted(weighed, key=lambda pair: pair[1].evidence)}
        for name in rivals:
            own = replace(taken, effects=(*(e for e in taken.effects if e != name), name))
            mine = [e for n, e in weighed if n == name == nearest[e.effects[-1]]]
            alike = [e for e in mine if not self.rivals.told_apart(own, e)]
            plainer = effect_class(name).plainer
            first, *rest = sorted([own, *alike], key=lambda e: e.effects[-1] not in plainer)
            settled = first if first is own else self._settled(first, self.layout, list(base))
            groups[name] = [settled, *rest]
        return None, {name: group for name, group in groups.items() if len(group) > 1}

    def _joined(
        self, best: FittedHypothesis, other: FittedHypothesis, at: Layout, base: list[str], factor: float
    ) -> FittedHypothesis | None:
        """Return two explanations as one, where each is needed beside the other; then they are no rivals.

        Of two effects that are both missing, one alone may do as badly as the other.
        """
        try:
            both = self.rivals.together(best, other, at, base)
        except FitError:
            return None
        gain = log_evidence(self.layout, both, factor).evidence - best.evidence
        if gain < ODDS or not improves_predictive_density(both, best):
            return None
        return self._settled(both, at, base)
