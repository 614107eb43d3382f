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
from functools import partial

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.commands.uncertain import in_closed_loop
from auvnn.diagnosis.noise_law.first_law import first_law
from auvnn.diagnosis.noise_law.hypothesis import (
    GROUP,
    Hypothesis,
    WithForce,
    explains_an_axis,
    in_newtons,
    judged,
    stands_out,
    tied,
)
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED, LawFits
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import STEPS
from auvnn.diagnosis.noise_law.likelihood.sums import CELL, ForceSums, force_sums
from auvnn.diagnosis.noise_law.model_average import averaged
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction, predicted_by_inputs
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits, Round, RoundResult
from auvnn.diagnosis.noise_law.rounds.looking_ahead import Branch, decided, shared, worth_following
from auvnn.diagnosis.noise_law.rounds.names_given import ALPHA_NAME, FIRST_COST, NamesGiven
from auvnn.diagnosis.score_tests.null_tests import NullTests, Tested
from auvnn.diagnosis.selection.choose import ALPHA
from auvnn.diagnosis.selection.model_comparison import ODDS, confused
from auvnn.diagnosis.stages.state import Setting
from auvnn.estimation.priors import parameters_of
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.rollouts import scale_of
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Share of the gain of all names that a further one must bring.
FURTHER_SHARE = 0.1
# Steps of the fit without any name.
NULL_STEPS = 25


class ForceSearch:
    """The search together with a stochastic force, of one log.

    Args:
        asked: what is asked.
        windows: of the log, without a law.
        closed_loop: whether commands are known to answer the motion; else it is asked of the fit without any name.
    """

    def __init__(self, asked: Setting, windows: Windows, *, closed_loop: bool = False) -> None:
        """Begin without a law."""
        self.layout, self.windows = asked.layout, windows
        self.usable, self.base, self.say = list(asked.usable), list(asked.base), asked.say
        self.names = NamesGiven(asked.layout, asked.log, scale_of(asked.log), asked.tolerance)
        self.names.white_noise = windows.noise is None
        self.names.in_closed_loop = closed_loop
        self.sigma = self.weights = np.full(18, np.inf)
        self.cell = CELL
        self.response: Array | None = None
        self.looks_further = False
        # What was asked at an explanation, for a second search that passes there: its tests, and where it went with a law
        # of its own.
        self._tests: dict[int, Tested] = {}
        self._gone_on: dict[int, tuple[Hypothesis, Hypothesis]] = {}
        self._leaders: LeaderFits | None = None
        # Values of effects that were fitted when nothing was chosen.
        self._earlier: dict[str, Array] = {}

    def begin(self, first: FittedHypothesis, sigma: Array, steps: int = NULL_STEPS) -> Hypothesis | None:
        """Return an explanation under the law of the force; None where no variance is above zero.

        Args:
            first: the fit without any effect, beside which names are sought; or one with names that stand.
            sigma: (18,) the sensors' white noise.
            steps: of its fit under the law; with none its parameters stay.
        """
        self.say("estimating the law of the force that is left")
        # Fits without the force weigh errors as the first one did.
        self.sigma, self.weights = sigma, first.fitted.sigma
        self.response = GreyBox(first.fitted.model.vehicle).prepare().inverse.detach().numpy()
        found = first_law(first, self.windows, sigma, self.response)
        if found is None:
            return None
        self.cell = found.cell
        # All names are compared with it: it must not gain by steps that names take first.
        null = self._fits().settled(self.judged(found.explanation, found.law), steps)
        with suppress(*UNSOLVED):
            self.names.in_closed_loop = self.names.in_closed_loop or in_closed_loop(
                null.explanation, self.windows
            )
        return null

    def _about(self, explanation: FittedHypothesis, law: ForceLaw | None = None) -> Windows:
        """Return the windows, linear about an explanation's trajectories, with a law or without."""
        return replace(self.windows, law=law, around=explanation.around)

    def _fits(self) -> LawFits:
        return LawFits(self.windows, self.weights, self.judged)

    def judged(self, explanation: FittedHypothesis, law: ForceLaw, held: bool = False) -> Hypothesis:
        """Return an explanation with the law that is most likely with it, or with the one given, and what they are worth.

        Args:
            explanation: the explanation.
            law: to begin from.
            held: whether the law stays as it is.
        """
        return judged(
            self.layout, explanation, self._sums(explanation), self.sigma, law, 0 if held else STEPS
        )

    def _sums(self, explanation: FittedHypothesis) -> ForceSums:
        """Return what the windows say of parameters and force, linear about an explanation's trajectories."""
        return force_sums(explanation, self._about(explanation), self.sigma, self.cell, self.response)

    def run(self, null: Hypothesis, fitted: Sequence[FittedHypothesis], most: int) -> WithForce:
        """Search for one effect after the other.

        Args:
            null: from `begin`.
            fitted: explanations of one effect that the first search has fitted.
            most: look for at most this many.
        """
        current, chosen = null, list[str]()
        steps: list[SearchStep] = []
        groups: list[list[FittedHypothesis]] = []
        tried: list[Hypothesis] = []
        whole, rivals, ahead, explains = 1.0, list[Hypothesis](), False, False
        while len(chosen) < most:
            grouped = [e.effects[-1] for g in groups for e in g]
            result = self._round(null, current, chosen, grouped, fitted)
            if result is None:
                break
            if not chosen:
                tried, whole = (
                    result.found,
                    min([result.at.tested.p_value, *result.sure.values()], default=1.0),
                )
            good = result.good
            if not good or (chosen and self._takes_up(good[0], chosen)):
                rivals = result.found if chosen else []
                break
            if not chosen and most > 1:
                good = self._looking_ahead(null, good, fitted)
            group = tied(self.layout, good, current)
            if len(group) > GROUP:
                break
            names = [h.name for h in group]
            verdict = "ambiguous" if len(group) > 1 else "named"
            steps.append({"verdict": verdict, "effects": names, "p_value": result.sure[group[0].name]})
            current = self._settled(group[0])
            if not chosen:
                ahead, explains = stands_out(group[0], result.found, null), explains_an_axis(current, null)
                if (ahead or explains) and not self.names.paying([group[0]], null, FIRST_COST):
                    ahead = explains = False
            if len(group) > 1:
                groups.append([current.explanation, *(h.explanation for h in group[1:])])
            chosen.append(group[0].name)
        under_law = self._fits()
        law = current.estimate.law
        assert law is not None
        # From here on free running counts again.
        return WithForce(
            steps,
            [[under_law.told(e) for e in group] for group in groups],
            under_law.told(averaged(self.layout, current, rivals)),
            self._about(current.explanation, law),
            replace(current.estimate, law=in_newtons(law, current.explanation)),
            self._told(tried),
            whole,
            in_newtons(null.estimate.law, null.explanation),
            self.predicted(current),
            ahead,
            explains,
        )

    def _round(
        self,
        null: Hypothesis,
        current: Hypothesis,
        chosen: Sequence[str],
        grouped: Sequence[str],
        fitted: Sequence[FittedHypothesis],
    ) -> RoundResult | None:
        """Return what a round has found beside an explanation; None where nothing significant is left."""
        remaining = [n for n in self.usable if n not in chosen and n not in grouped]
        if not remaining:
            return None
        base = [*self.base, *[c for c in chosen if c not in self.base]]
        tests = self._tested(current, remaining, base, list(chosen))
        # Beside what was found the variance is no longer inflated by it: the tests say whether to go on.
        if chosen and tests.p_value >= ALPHA:
            return None
        share = 0.0 if self.looks_further else FURTHER_SHARE
        odds = max(ODDS, share * (current.evidence - null.evidence))
        at = Round(tests, current, base, list(chosen), self._earlier if chosen else {})
        good_of = partial(self.names.good, at, len(remaining))
        self._leaders = self._leaders or LeaderFits(self.layout, self._fits(), self.say)
        found, good = self._leaders.fitted(at, fitted, odds, ALPHA_NAME, good_of)
        if not chosen:
            self._earlier = {h.name: parameters_of(h.explanation.fitted.model, [h.name]) for h in found}
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
            self._gone_on[id(found)] = found, self._fits().settled(found)
        return self._gone_on[id(found)][1]

    def _told(self, tried: Sequence[Hypothesis]) -> list[FittedHypothesis]:
        """Return explanations with their errors of free running, those aside whose free running grows without bound."""
        told = []
        for h in tried:
            with suppress(*UNSOLVED):
                told.append(self._fits().told(h.explanation))
        return told

    def predicted(self, found: Hypothesis) -> InputPrediction | None:
        """Return what measured inputs predict of the force that an explanation leaves; None where that is little."""
        self.say("asking how much of the force measured inputs predict")
        about, law = self._about(found.explanation), found.estimate.law
        sums, closed = self._sums(found.explanation), self.names.in_closed_loop
        told = predicted_by_inputs(found.weighed, about, sums, law, closed_loop=closed)
        return told if told is not None and told.matters else None

    def _tested(
        self, current: Hypothesis, remaining: list[str], base: list[str], chosen: list[str]
    ) -> Tested:
        """Return the tests of what remains beside an explanation."""
        if id(current) not in self._tests:
            self.say(f"testing {len(remaining)} effects together with the force")
            windows = self._about(current.explanation, current.estimate.law)
            tests = NullTests(self.layout, windows, self.say)
            self._tests[id(current)] = tests(current.weighed, remaining, base, chosen)
        return self._tests[id(current)]

    def _takes_up(self, further: Hypothesis, chosen: Sequence[str]) -> bool:
        """Whether a further effect only takes up what the shape of an earlier one gets wrong.

        Where thrust ahead and astern follow curves of another shape, a mean force is left beside the asymmetry that is
        named: an effect that the catalogue knows to be confused with an earlier one, and beside which measured inputs
        still predict the force, is no further cause.
        """
        known = any(confused(further.name, name) for name in chosen)
        return known and self.predicted(further) is not None
