"""The leading effects of a round, fitted in full beside what was found and judged under laws of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, initial_guess, shapes
from auvnn.diagnosis.hypotheses.within_record import within_record
from auvnn.diagnosis.noise_law.hypothesis import Hypothesis
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED, LawFits
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.leaders import contained_in, rivals_of
from auvnn.diagnosis.selection.acting_together import (
    begin_beside,
    comes_with,
    worth_fitting_together,
)
from auvnn.diagnosis.selection.model_comparison import ODDS, confused
from auvnn.effects.acting_beside import last_names
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.executors import Executor
from auvnn.executors.serial import SERIAL
from auvnn.progress import silent

Array = NDArray[np.float64]
# Fitted in full beside those that the first search has fitted: so many of those that lead under the law, and so many more
# of those whose tests are significant where none of these stands.
LEADERS, FURTHER_LEADERS = 3, 5
# So many of those that lead one step ahead are fitted in full, too; as a further name so many of those that led alone.
LEADERS_ONE_STEP, LEADERS_ALONE = 2, 2
# Share of the odds that a further name needs, which its test must promise before it is fitted; of no more than these
# odds, however large the gain of the names before it. A first name that is ahead by less is compared with more effects.
WORTH_A_FIT, LARGE_ODDS = 0.3, 300.0


@dataclass(frozen=True)
class LeaderFits:
    """Fits the effects that lead.

    Attributes:
        layout: stated values.
        fits: under laws of the force.
        say: called with what is being done, in words.
        pool: who fits effects of which none has to wait for another.
        known: what was fitted beside an explanation, by that and the effect's name: a search that passes there again asks
            for the same.
    """

    layout: Layout
    fits: LawFits
    say: Callable[[str], None]
    pool: Executor = SERIAL
    known: dict[tuple[int, str], tuple[Hypothesis, Hypothesis | None]] = field(default_factory=dict)

    def fitted(
        self, at: Round, alone: Sequence[FittedHypothesis], odds: float, level: float,
        good: Callable[[list[Hypothesis], float], list[Hypothesis]],
    ) -> tuple[list[Hypothesis], list[Hypothesis]]:  # fmt: skip
        """Return what has been fitted in a round, and what of it may be named, both the most evident first.

        Args:
            at: the round.
            alone: explanations of one effect that the first search has fitted.
            odds: logarithm of the odds that a name needs.
            level: at which chance among all effects is rejected.
            good: returns what of such explanations may be named at such odds.
        """
        self.leading(at, alone, odds, level)
        found = self._beside(at)
        named = good(found, odds)
        # A small lead is none before more of those whose tests are significant have been fitted.
        if not at.chosen and not (named and named[0].evidence > at.current.evidence + LARGE_ODDS):
            self.wider(at, found, level)
            found = self._beside(at)
            named = good(found, odds)
        return found, named

    def _beside(self, at: Round) -> list[Hypothesis]:
        """Return what was fitted beside an explanation, now and by an earlier search, the most evident first."""
        able = {*at.tested.scores, *at.chosen}
        return _by_evidence(
            h for h in self._fitted_beside(at.current) if able.issuperset(last_names(h.explanation.effects))
        )

    def _fitted_beside(self, current: Hypothesis) -> list[Hypothesis]:
        return [h for (where, _), (_, h) in self.known.items() if where == id(current) and h is not None]

    def gains(self, current: Hypothesis) -> dict[str, float]:
        """Return what each effect that was fitted beside an explanation gains there, in the logarithm of the odds.

        Args:
            current: the explanation.
        """
        return {h.name: h.evidence - current.evidence for h in self._fitted_beside(current)}

    def take(self, current: Hypothesis, found: Hypothesis) -> None:
        """Keep a fit that another search made, where it is likelier than what was fitted here.

        Args:
            current: the explanation beside which it is a further name.
            found: the explanation with it.
        """
        _, known = self.known.get((id(current), found.name), (current, None))
        if known is None or known.evidence < found.evidence:
            self.known[id(current), found.name] = current, found

    def leading(
        self, at: Round, fitted: Sequence[FittedHypothesis], odds: float, level: float
    ) -> list[Hypothesis]:
        """Return the leading effects, fitted and judged, the most evident first.

        Args:
            at: the round.
            fitted: explanations of one effect that the first search has fitted.
            odds: logarithm of the odds that a name needs.
            level: at which chance among all effects is rejected.
        """
        known = self._known(at, fitted)
        worth = self._worth(at, known, WORTH_A_FIT * min(odds, LARGE_ODDS))
        places = at.places > 1
        beside = worth_fitting_together(self.layout, at.chosen, at.tested.scores, at.base) if places else []
        found = self._each([*known, *worth, *_ahead(at, odds), *beside], at, known)
        # Beside what was found tests are weaker: a rival of a further name need not be clear among all effects.
        rivals = rivals_of(found, at.tested.scores, level, among_all=not at.chosen)
        found += self._each(rivals, at)
        names = [h.name for h in found]
        for name, begin in contained_in(self.layout, found, at.current, at.tested.scores).items():
            plain = self._from([begin], name, at)
            if plain is not None:
                self.take(at.current, plain)
                names.append(name)
        return _by_evidence(self._each(names, at))

    def wider(self, at: Round, found: Sequence[Hypothesis], level: float) -> list[Hypothesis]:
        """Return what was found together with more of the effects whose tests are significant, fitted and judged.

        A large effect may be behind others where its slope at the null says little of it: before nothing is said to have
        a name, these are fitted too.

        Args:
            at: the round.
            found: what has been fitted.
            level: at which chance among all effects is rejected.
        """
        known, scores = {h.name for h in found}, at.tested.scores
        told = [n for n, s in scores.items() if s.degrees]
        more = [n for n in told if n not in known and scores[n].p_value * len(told) < level]
        more = sorted(more, key=lambda n: -scores[n].evidence)[:FURTHER_LEADERS]
        return _by_evidence([*found, *self._each(more, at)])

    def _known(self, at: Round, fitted: Sequence[FittedHypothesis]) -> dict[str, FittedHypothesis]:
        """Return the effects that the first search has fitted alone, while nothing is chosen."""
        known: dict[str, FittedHypothesis] = {}
        for e in [] if at.chosen else fitted:
            name = e.effects[-1]
            told = name in at.tested.scores and at.tested.scores[name].degrees
            if told and (name not in known or e.fitted.cost < known[name].fitted.cost):
                known[name] = e
        return known

    def _worth(self, at: Round, known: Iterable[str], odds: float) -> list[str]:
        """Return the effects that lead under the law, without those that are known."""
        scores = {n: s for n, s in at.tested.scores.items() if s.degrees}
        order = sorted(scores, key=lambda n: -scores[n].evidence)[:LEADERS]
        # Where few windows tell of an effect (drag that grows with time), its evidence is small and its gain is not.
        by_gain = sorted(scores, key=lambda n: scores[n].degrees - scores[n].gain)
        by_gain = by_gain[: 1 if at.chosen else LEADERS]
        # A further name must bring much: what promises a small part of that is not worth a fit.
        worth = [n for n in dict.fromkeys([*order, *by_gain]) if not at.chosen or 0.5 * scores[n].gain > odds]
        return [n for n in worth if n not in {*known}]

    def _each(
        self, names: Iterable[str], at: Round, known: Mapping[str, FittedHypothesis] | None = None
    ) -> list[Hypothesis]:
        names = list(dict.fromkeys(names))
        new = [n for n in names if (id(at.current), n) not in self.known]
        alone = replace(self, say=silent, pool=SERIAL, known={})
        fitted = self.pool.run(_fitted, (alone, at), [(n, (known or {}).get(n)) for n in new])
        for name in new:
            self.say(f"fitting {name} together with the force")
            # The explanation is kept with what was fitted: no other one can have its place then.
            self.known[id(at.current), name] = at.current, next(fitted)
        found = [self.known[id(at.current), name][1] for name in names]
        return [h for h in found if h is not None]

    def _one(self, name: str, at: Round, known: FittedHypothesis | None) -> Hypothesis | None:
        """Return an effect fitted under the law; None where nothing can be said of it.

        It is fitted from where it is absent: a fit of output errors may have been driven far off by the force. A large
        effect is seldom where its slope says: where the first search has fitted it, and as a further name where it was
        as the first, it is fitted from there too.

        Args:
            name: the effect.
            at: the round.
            known: its fit by the first search.
        """
        tested = at.tested
        null = parameters_of(tested.at.model, [name])
        # At its null place and time an effect says nothing of them: they are where its test has found them.
        shape = shapes(self.layout, name)
        begins = [np.where(shape, initial_guess(self.layout, name, tested.scores[name].estimate), null)]
        begins += [] if known is None else [parameters_of(known.fitted.model, [name])]
        begins += [at.begins[name]] if name in at.begins else []
        alone = self._from(begins, name, at)
        # Two names are given for one where they are likelier by as much as a name needs.
        others = comes_with(name, at.chosen, tested.scores, at.base) if at.places > 1 else []
        together = [self._from(begins[:1], name, at, other) for other in others]
        least = -np.inf if alone is None else alone.evidence + ODDS
        found = [h for h in together if h is not None and h.evidence > least]
        return max(found, key=lambda h: h.evidence, default=alone)

    def _from(
        self, begins: Sequence[Array], name: str, at: Round, beside: str | None = None
    ) -> Hypothesis | None:
        """Return the likeliest fit of an effect from several values of its parameters; None where there is none.

        Args:
            begins: values of its parameters.
            name: the effect.
            at: the round.
            beside: an effect that acts beside it only, and is fitted with it.
        """
        tested, found = at.tested, list[Hypothesis]()
        for begin in begins:
            model = tested.at.model.rebuilt(tested.at.model.copied_effects())
            set_parameters(model, [name], begin)
            with_it = [] if beside is None else [beside]
            for other in with_it:
                set_parameters(model, [other], begin_beside(self.layout, other))
            with suppress(*UNSOLVED):
                # Another beginning is followed where it promises more than where an earlier one has led.
                least = max([at.current.evidence, *(h.evidence for h in found)])
                asked = [*at.chosen, *with_it, name]
                found.append(self.fits.from_null(self.layout, model, at.current, at.base, asked, least))
        seen = [h for h in found if within_record(h.explanation, self.fits.windows)]
        return max(seen, key=lambda h: h.evidence, default=None)


def _ahead(at: Round, odds: float) -> list[str]:
    """Return effects that are fitted in full whatever their tests promise.

    The slope at the null says little of a large effect, beside a name as before it: what brought as much alone as a
    further name needs is fitted beside the name, unless the catalogue knows that both explain the same.

    Args:
        at: the round.
        odds: logarithm of the odds that a name needs.
    """
    told = [n for n, s in at.tested.scores.items() if s.degrees]
    if not at.chosen:
        return [n for n in at.begins if n in told][:LEADERS_ONE_STEP]
    led = [n for n, gain in at.alone.items() if n in told and gain > odds]
    return [n for n in led if not any(confused(n, c) for c in at.chosen)][:LEADERS_ALONE]


def _fitted(shared: tuple[LeaderFits, Round], task: tuple[str, FittedHypothesis | None]) -> Hypothesis | None:
    """Return an effect fitted under the law, see `LeaderFits._one`: a task of an executor."""
    looks, at = shared
    return looks._one(task[0], at, task[1])


def _by_evidence(found: Iterable[Hypothesis]) -> list[Hypothesis]:
    return sorted(found, key=lambda h: -h.evidence)
