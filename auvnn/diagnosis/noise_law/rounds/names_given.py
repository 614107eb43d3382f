"""Which of the explanations of a round may be named: by evidence, by what is left out, and by what a name costs."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.hypothesis import (
    Hypothesis,
    brings_most,
    explains_an_axis,
    p_value_of,
    predicts_better,
)
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.free_running_cost import (
    cost_of_name,
    free_running_cost,
    model_of,
    paying,
)
from auvnn.diagnosis.selection.model_comparison import ODDS, confused
from auvnn.logs import Log
from auvnn.metrics.rollouts import Scale

# A name is given where chance would seldom do as well among all effects that were asked for; a further one on
# stronger grounds, because each time chance gets another turn.
ALPHA_NAME, ALPHA_FURTHER = 0.01, 0.001
# Standard errors by which runs left out must be predicted better.
GAIN, GAIN_FURTHER = 1.0, 3.0
# What the first name and a further one must cost in free running, as shares of the tolerance (a force is always there
# and makes errors that no name takes away).
FIRST_COST, FURTHER_COST = 0.5, 1.0
# Logarithm of the odds at which a name is given whatever it costs: with nothing hidden, in worlds that the model does not
# describe, an effect that is not there has reached 758 (`thrust_overshoot` in `shaped`, of 20 logs).
DECISIVE = 2000.0


@dataclass
class NamesGiven:
    """Says which explanations may be named, of one log.

    Attributes:
        layout: stated values.
        log: on which models run freely.
        scale: of the errors there.
        tolerance: what does not matter.
        ignores_cost: whether a name may cost little.
        in_closed_loop: whether commands answer the motion.
        white_noise: whether the sensors' noise is white; a further name must then be sure in the mean.
    """

    layout: Layout
    log: Log
    scale: Scale
    tolerance: Tolerance
    ignores_cost: bool = False
    in_closed_loop: bool = False
    white_noise: bool = True

    def good(self, at: Round, among: int, found: Sequence[Hypothesis], odds: float) -> list[Hypothesis]:
        """Return those explanations that may be named, the most evident first.

        Args:
            at: the round.
            among: how many effects were asked for.
            found: explanations that were judged.
            odds: logarithm of the odds that a name needs.
        """
        likely = self.likely(at, among, found, odds)
        clear = [h.name for h in likely if _shows(h, at)]
        sure = GAIN_FURTHER if at.chosen else GAIN
        most = [h.name for h in likely if not predicts_better(h, at.current, sure, ranks=False)]
        return self.paying(likely, at.current, FURTHER_COST if at.chosen else FIRST_COST, clear, most)

    def likely(self, at: Round, among: int, found: Sequence[Hypothesis], odds: float) -> list[Hypothesis]:
        """Return those explanations that the data prefer by so much, whatever they cost, the most evident first.

        What is likelier than the first of them, and known to be confused with it, is compared with it, though it predicts
        runs left out less surely, or leaves more of a force for which fewer odds are asked.

        Args:
            at: the round.
            among: how many effects were asked for.
            found: explanations that were judged.
            odds: logarithm of the odds that a name needs.
        """
        level, least = (ALPHA_FURTHER, GAIN_FURTHER) if at.chosen else (ALPHA_NAME, GAIN)
        now = at.current
        likely = [h for h in found if h.evidence > now.evidence + ODDS and self.sure(h, at, among) < level]
        ranks = not (at.chosen and self.white_noise)
        better = [
            k
            for k, h in enumerate(likely)
            if (h.evidence > now.evidence + odds or _shows(h, at) or explains_an_axis(h, now))
            and predicts_better(h, now, least, ranks=ranks)
        ]
        if not better:
            return []
        first = better[0]
        return [
            h
            for k, h in enumerate(likely)
            if k in better or (k < first and confused(h.name, likely[first].name))
        ]

    def worsen(self, named: Hypothesis, null: Hypothesis) -> bool:
        """Return whether all names together make free running worse, in all windows and in the median one.

        One right name may do so, under a controller above all, because others are missing still; all of them may not.

        Args:
            named: the explanation with all names.
            null: the one without any.
        """
        if self.tolerance.strict:
            return False
        cost = free_running_cost(model_of(named), model_of(null), self.log, self.scale)
        return cost.least < -FIRST_COST * self.tolerance.cost

    def sure(self, found: Hypothesis, at: Round, among: int) -> float:
        """Return the p-value of an effect among so many that were asked for, by the likelihood ratio.

        Args:
            found: explanation with the effect.
            at: the round.
            among: how many effects were asked for.
        """
        return min(1.0, among * p_value_of(self.layout, found, at.current))

    def pays(self, after: Hypothesis, before: Hypothesis) -> bool:
        """Whether a further name costs enough.

        Args:
            after: the explanation in which it is the last one.
            before: the one without it.
        """
        return bool(self.paying([after], before, FURTHER_COST))

    def paying(
        self,
        likely: Sequence[Hypothesis],
        current: Hypothesis,
        share: float,
        clear: Collection[str] = (),
        most: Collection[str] = (),
    ) -> list[Hypothesis]:
        """Return what costs so large a share of the tolerance in free running, and what goes with it.

        Args:
            likely: explanations, the most evident first.
            current: the explanation without any of the names.
            share: of the tolerance.
            clear: names that take away most of a force: what they do with everything else as it is counts, too.
            most: names with which most windows are predicted better, and not surely the mean: the median window counts.
        """
        if self.tolerance.strict:
            return list(likely)
        enough = 0.0 if self.ignores_cost else share * self.tolerance.cost
        costs, worse = [], []
        for h in likely:
            if h.evidence > current.evidence + DECISIVE:
                costs.append(float("inf"))
                worse.append(False)
                continue
            cost = cost_of_name(self.layout, h, current, self.log, self.scale, others_stay=h.name in clear)
            # Where the sensors are not what they should be, a few wrong starts may decide the error of all windows; and
            # wherever their differences do not say that the mean is worse, so may a few in which the vehicle tumbles.
            surely_worse = self.white_noise and cost.worse
            paid, moves = cost.error if surely_worse else cost.least, cost.moves
            if h.name in most:
                # A few windows in which a vehicle nearly loses its way make the error of all, and any name may catch it.
                paid, moves = cost.typical, cost.moves_typically
            costs.append(max(paid, moves) if self.in_closed_loop else paid)
            # What hardly moves predictions contradicts nothing, be its error a thousandth larger or smaller.
            matters = max(-cost.error, cost.moves) > share * self.tolerance.cost
            worse.append(costs[-1] <= 0.0 and (self.white_noise or cost.worse) and matters)
        return paying(likely, costs, enough, worse)


def _shows(found: Hypothesis, at: Round) -> bool:
    """Whether a further name takes away most of the force of a degree of freedom, see `brings_most`."""
    return at.null is not None and bool(at.chosen) and brings_most(found, at.current, at.null)
