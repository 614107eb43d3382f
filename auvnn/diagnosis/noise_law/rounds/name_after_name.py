"""One name after the other, together with a stochastic force: rounds of tests, fits and comparisons."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.hypothesis import (
    GROUP,
    Hypothesis,
    explains_an_axis,
    stands_out,
    tied,
)
from auvnn.diagnosis.noise_law.rounds.a_round import Round, RoundResult
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.noise_law.rounds.looking_ahead import (
    RIVALS_SHARE,
    Branch,
    decided,
    shared,
    worth_following,
)
from auvnn.diagnosis.noise_law.rounds.names_given import ALPHA_NAME, FIRST_COST, NamesGiven
from auvnn.diagnosis.noise_law.rounds.one_step_leaders import fitted_one_step
from auvnn.diagnosis.noise_law.rounds.path import Path
from auvnn.diagnosis.noise_law.under_law import NULL_STEPS, UnderLaw
from auvnn.diagnosis.residuals.forces import exerts_less
from auvnn.diagnosis.score_tests.null_tests import NullTests, Tested
from auvnn.diagnosis.selection.acting_together import named_with
from auvnn.diagnosis.selection.choose import ALPHA, FORM, LITTLE
from auvnn.diagnosis.selection.model_comparison import ODDS, confused, forms_that_leave
from auvnn.diagnosis.stages.state import Setting
from auvnn.effects import effect_class
from auvnn.estimation.priors import parameters_of
from auvnn.metrics.rollouts import scale_of
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Share of the gain of all names that a further one must bring.
FURTHER_SHARE = 0.1


class NameAfterName(UnderLaw):
    """Rounds of a search together with a stochastic force, of one log.

    Args:
        asked: what is asked.
        windows: of the log, without a law.
        closed_loop: whether commands are known to answer the motion; else it is asked of the fit without any name.
    """

    # How many names may be given, said where a search begins; and whether `_takes_up` passes over none of them.
    most: float = np.inf
    passes_over_none = False

    def __init__(self, asked: Setting, windows: Windows, *, closed_loop: bool = False) -> None:
        """Begin without a law."""
        super().__init__(asked, windows, closed_loop=closed_loop)
        self.asked = asked
        self.usable = list(asked.usable)
        self.names = NamesGiven(asked.layout, asked.log, scale_of(asked.log), asked.tolerance)
        self.names.white_noise = windows.noise is None
        self.looks_further = False
        # What was asked at an explanation, for a second search that passes there: its tests, and where it went with a law
        # of its own.
        self._tests: dict[int, tuple[frozenset[str], Tested]] = {}
        self._gone_on: dict[int, tuple[Hypothesis, Hypothesis]] = {}
        self._leaders: LeaderFits | None = None
        # What was fitted without a name, or with a rival in its place, kept with what it came from.
        self._refits: dict[
            tuple[int, str, int, bool], tuple[Hypothesis, FittedHypothesis | None, Hypothesis | None]
        ] = {}
        # Values of effects that were fitted when nothing was chosen, and the odds that they brought then.
        self._earlier: dict[str, Array] = {}
        self._alone: dict[str, float] = {}

    @cached_property
    def _one_step(self) -> dict[str, Array]:
        """Values of effects fitted one step ahead; worked out where a search begins without any name."""
        return fitted_one_step(self.asked)

    def begin(self, first: FittedHypothesis, sigma: Array, steps: int = NULL_STEPS) -> Hypothesis | None:
        """Return an explanation under the law of the force; None where no variance is above zero.

        Args:
            first: the fit without any effect, beside which names are sought; or one with names that stand.
            sigma: (18,) the sensors' white noise.
            steps: of its fit under the law; with none its parameters stay.
        """
        null = super().begin(first, sigma, steps)
        self.names.in_closed_loop = self.in_closed_loop
        return null

    def names_after(
        self, path: Path, null: Hypothesis, fitted: Sequence[FittedHypothesis], most: int
    ) -> tuple[list[Hypothesis], float]:
        """Go on with one name after the other; return what was tried at first, and the p-value of there being nothing.

        Args:
            path: where the search has come; it goes on there.
            null: the explanation without any name.
            fitted: explanations of one effect that the first search has fitted.
            most: look for at most this many.
        """
        tried, whole, self.most = list[Hypothesis](), 1.0, most
        while len(path.chosen) < most:
            # What could not be told from a name may be missing beside it: then it is no rival.
            result = self._round(null, path.current, path.chosen, path.dropped, fitted)
            if result is None:
                break
            if not path.chosen:
                tried, whole = (
                    result.found,
                    min([result.at.tested.p_value, *result.sure.values()], default=1.0),
                )
            good = result.good
            while path.chosen and good and self._takes_up(good[0], path, null):
                # What cannot be told from it takes up the same.
                good = [h for h in good[1:] if not confused(h.name, good[0].name)]
            if not good:
                path.not_named = result.found if path.chosen else []
                break
            if not path.chosen and most > 1:
                good = self._looking_ahead(null, good, fitted)
            group = self._with_simpler(tied(self.layout, good, path.current), good, path, null)
            if len(group) > GROUP:
                break
            path.take_apart(group[0].name)
            group = [h for h in group if h.name not in path.rivals]
            verdict, names = "ambiguous" if len(group) > 1 else "named", [h.name for h in group]
            path.steps.append({"verdict": verdict, "effects": names, "p_value": result.sure[group[0].name]})
            path.current = current = self._settled(group[0])
            if not path.chosen:
                ahead, explains = stands_out(group[0], result.found, null), explains_an_axis(current, null)
                pays = (ahead or explains) and self.names.paying([group[0]], null, FIRST_COST)
                path.stands_out, path.explains = bool(pays) and ahead, bool(pays) and explains
            if len(group) > 1:
                path.groups.append([current.explanation, *(h.explanation for h in group[1:])])
            path.chosen.append(group[0].name)
            for name in named_with(group[0].explanation.effects, path.chosen):
                path.steps.append({**path.steps[-1], "verdict": "named", "effects": [name]})
                path.chosen.append(name)
                # Told in the order of the steps, whoever goes on from there: first what moves the water.
                ordered = replace(current.explanation, effects=tuple(path.chosen))
                path.current = replace(current, explanation=ordered)
        return tried, whole

    def _with_simpler(
        self, group: list[Hypothesis], good: Sequence[Hypothesis], path: Path, null: Hypothesis
    ) -> list[Hypothesis]:
        """Return a group with what explains the trace by fewer parameters, short by less than is still unexplained.

        What the best further effect gains, or promises, beside the best of the group is how far the model is known to be
        wrong, and an effect of many parameters takes up some of that wherever it is.

        Args:
            group: the best and those that the log cannot tell from it.
            good: all that may be named.
            path: with the names before them.
            null: the explanation without any name.
        """
        best, sizes = max(group, key=lambda h: h.evidence), self.layout.columns
        least = RIVALS_SHARE * (best.evidence - path.current.evidence)
        simpler = [
            h
            for h in good
            if h.evidence - path.current.evidence >= least and confused(h.name, best.name)
            if h not in group and len(sizes[h.name]) < len(sizes[best.name])
        ]
        if not simpler or len(group) >= GROUP:
            return group
        chosen, dropped = [*path.chosen, best.name], self._passed(path)
        beside = Path(self._settled(best), chosen, dropped=dropped)
        self._round(null, beside.current, chosen, dropped, ())
        rest = self.rest(beside)
        near = [h for h in simpler if best.evidence - h.evidence < rest]
        group = [*group, *near[: GROUP - len(group)]]
        return sorted(group, key=lambda h: h.name not in effect_class(best.name).plainer)

    def _passed(self, path: Path) -> list[str]:
        """Return the effects that are not asked for again."""
        return [*path.dropped, *[e.effects[-1] for g in path.groups for e in g]]

    def rest(self, path: Path) -> float:
        """Return what the best further effect gains beside all names, in the logarithm of the odds.

        What was fitted beside them gains what its fit does, which may be far less than its slope at the null promises.

        Args:
            path: with the names.
        """
        told = {n: s.evidence for n, s in self._tested_beside(path).scores.items() if s.degrees}
        fitted = {} if self._leaders is None else self._leaders.gains(path.current)
        return max([fitted.get(n, promised) for n, promised in told.items()], default=0.0)

    def _tested_beside(self, path: Path) -> Tested:
        """Return the tests of the effects that are still asked for beside all names."""
        remaining = [n for n in self.usable if n not in {*path.chosen, *self._passed(path)}]
        return self._tested(path.current, remaining, self._free(path.chosen), list(path.chosen))

    def _free(self, chosen: Sequence[str]) -> list[str]:
        """Return the effects that are free where some are named."""
        return [*self.base, *[c for c in chosen if c not in self.base]]

    def _round(
        self,
        null: Hypothesis,
        current: Hypothesis,
        chosen: Sequence[str],
        passed: Sequence[str],
        fitted: Sequence[FittedHypothesis],
    ) -> RoundResult | None:
        """Return what a round has found beside an explanation; None where nothing significant is left."""
        remaining = [n for n in self.usable if n not in chosen and n not in passed]
        if not remaining:
            return None
        base = self._free(chosen)
        tests = self._tested(current, remaining, base, list(chosen))
        # Beside what was found the variance is no longer inflated by it: the tests say whether to go on.
        if chosen and tests.p_value >= ALPHA:
            return None
        share = 0.0 if self.looks_further else FURTHER_SHARE
        odds = max(ODDS, share * (current.evidence - null.evidence))
        begins, alone = (self._earlier, self._alone) if chosen else (self._one_step, {})
        at = Round(tests, current, base, list(chosen), begins, null, alone, self.most - len(chosen))
        good_of = partial(self.names.good, at, len(remaining))
        self._leaders = self._leaders or LeaderFits(self.layout, self.fits(), self.say, self.pool)
        found, good = self._leaders.fitted(at, fitted, odds, ALPHA_NAME, good_of)
        if not chosen:
            self._earlier = {h.name: parameters_of(h.explanation.fitted.model, [h.name]) for h in found}
            self._alone = {h.name: h.evidence - current.evidence for h in found}
        sure = {h.name: self.names.sure(h, at, len(remaining)) for h in found}
        return RoundResult(at, found, good, sure, len(remaining))

    def _looking_ahead(
        self, null: Hypothesis, good: list[Hypothesis], fitted: Sequence[FittedHypothesis]
    ) -> list[Hypothesis]:
        """Return the first names that may be given, the one to begin with first, see `looking_ahead`."""
        branches: list[Branch] = []
        for h in worth_following(good, null):
            after = self._settled(h)
            result = self._round(null, after, [h.name], [], fitted)
            further = [] if result is None else self.names.likely(result.at, result.among, result.found, ODDS)
            branches.append(Branch(h, after, further))
            if not further and len(branches) == 1:
                # Beside the first name nothing is left that another one could explain.
                return good
        assert self._leaders is not None
        for branch, pair in shared(branches):
            self._leaders.take(branch.after, pair)
        return decided(good, branches, null)

    def _settled(self, found: Hypothesis) -> Hypothesis:
        """Return an explanation beside which further names are sought."""
        if id(found) not in self._gone_on:
            # Kept with what it came from: no other explanation can have its place then.
            self._gone_on[id(found)] = found, self.fits().settled(found)
        return self._gone_on[id(found)][1]

    def _tested(
        self, current: Hypothesis, remaining: list[str], base: list[str], chosen: list[str]
    ) -> Tested:
        """Return the tests of what remains beside an explanation; of more than that they may have been made before."""
        asked, known = self._tests.get(id(current), (frozenset[str](), None))
        if known is None or not asked.issuperset(remaining):
            self.say(f"testing {len(remaining)} effects together with the force")
            windows = self.about(current.explanation, current.estimate.law)
            tests = NullTests(self.layout, windows, self.say)
            known = tests(current.weighed, remaining, base, chosen)
            self._tests[id(current)] = frozenset(remaining), known
        return replace(known, scores={n: s for n, s in known.scores.items() if n in remaining})

    def _takes_up(self, further: Hypothesis, path: Path, null: Hypothesis) -> bool:
        """Whether a further effect only takes up what earlier ones get wrong.

        Where thrust ahead and astern follow curves of another shape, a mean force is left beside the asymmetry that is
        named: an effect that the catalogue knows to be confused with an earlier one, that explains little beside it, and
        beside which measured inputs still predict the force, is no further cause. Nor is what is known to look like what
        the form of an earlier one gets wrong (`leaves`), exerting less than it; or than twice that if it explains little.

        Args:
            further: the explanation with it.
            path: with the names before it.
            null: the explanation without any.
        """
        forms = forms_that_leave(further.name, path.chosen)
        if self.passes_over_none or not (forms or any(confused(further.name, n) for n in path.chosen)):
            return False
        one_of_them = (path.current.evidence - null.evidence) / len(path.chosen)
        little = further.evidence - path.current.evidence < LITTLE * one_of_them
        if forms:
            about, times = self.about(further.explanation), FORM if little else 1.0
            return exerts_less(further.explanation, about, further.name, forms, self.asked.stated, times)
        return little and self.predicted(further) is not None
