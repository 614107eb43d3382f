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

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.first_law import first_law
from auvnn.diagnosis.noise_law.hypothesis import (
    GROUP,
    Hypothesis,
    WithForce,
    in_newtons,
)
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED, LawFits
from auvnn.diagnosis.noise_law.model_average import averaged
from auvnn.diagnosis.noise_law.rounds.beside_all_names import (
    as_good_in_place,
    costs_little,
    no_longer_needed,
    refitted,
    rivals_among,
    that_leads_instead,
    those_that_lose,
)
from auvnn.diagnosis.noise_law.rounds.name_after_name import NameAfterName
from auvnn.diagnosis.noise_law.rounds.path import Path
from auvnn.diagnosis.noise_law.rounds.plainer_causes import Change, Refit, nearly_in_place, plainer_rivals
from auvnn.diagnosis.noise_law.under_law import NULL_STEPS
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.selection.moved_by_unnamed import moved_by_unnamed, widened
from auvnn.diagnosis.selection.rivals import Rivals, rivals_tried, without_lost
from auvnn.diagnosis.stages.state import State
from auvnn.effects import effect_class

Array = NDArray[np.float64]


class ForceSearch(NameAfterName):
    """The search together with a stochastic force, of one log.

    Args:
        asked: what is asked.
        windows: of the log, without a law.
        closed_loop: whether commands are known to answer the motion; else it is asked of the fit without any name.
    """

    def run(self, null: Hypothesis, fitted: Sequence[FittedHypothesis], most: int) -> WithForce:
        """Search for one effect after the other.

        Args:
            null: from `begin`.
            fitted: explanations of one effect that the first search has fitted.
            most: look for at most this many.
        """
        path = Path(null, null=null)
        tried, whole = self.names_after(path, null, fitted, most)
        self._to_the_end(path, null, rivals_among(tried, null), fitted, most)
        return self._ended(path, null, tried, whole)

    def changed(self, named: Hypothesis, before: State) -> Path | None:
        """Return a path without the names that are not needed; None where each is, and has no rival that does as well.

        Args:
            named: from `begin`, with the names that another search found.
            before: where that search ended.
        """
        path = Path.of_names(self.fits().settled(named), before.steps)
        refit = self._refit(path.current)
        tied = [(lead.effects[-1], e) for lead, *others in before.groups for e in others]
        for (name, _), other in zip(tied, refit(tied), strict=True):
            if other is not None:
                path.tie(name, other)
        known, anything = len(self._passed(path)), False
        rivals = rivals_tried(path.chosen, before.tried, before.first.fitted.sigma)
        while (
            self._fewer(path, path.chosen)
            or self._exchanged(path, path.chosen, rivals)
            or self._cheaper(path, path.chosen[1:])
        ):
            anything = True
        # Names that stand leave next to nothing of the error: what is beside them withholds none.
        path.stands_out = True
        return path if anything or len(self._passed(path)) > known else None

    def go_on(self, path: Path, first: FittedHypothesis, before: State, most: int) -> WithForce:
        """Go on from names that are needed.

        Args:
            path: from `changed`, with at least one name.
            first: the fit without any, over the same windows.
            before: where the search that found them ended.
            most: look for at most this many.
        """
        assert self.response is not None
        begun = first_law(first, self.windows, self.sigma, self.response, self.cell)
        law = path.current.estimate.law
        assert law is not None
        null = self.judged(first, law) if begun is None else self.judged(begun.explanation, begun.law)
        null = self.fits().settled(null, NULL_STEPS)
        rivals = rivals_tried(path.chosen, before.tried, before.first.fitted.sigma)
        self.names_after(path, null, (), most)
        self._to_the_end(path, null, rivals, (), most)
        return self._ended(path, null, (), before.p_value)

    def _to_the_end(
        self,
        path: Path,
        null: Hypothesis,
        rivals: Rivals,
        fitted: Sequence[FittedHypothesis],
        most: int,
    ) -> None:
        """Compare names again beside all that were found, and go on as long as that changes one."""
        earlier = _to_ask(path)
        while self._fewer(path, earlier) or self._exchanged(path, earlier, rivals):
            self.names_after(path, null, fitted, most)
            earlier = _to_ask(path)
        if path.groups:
            self.say("comparing effects that could not be told apart, beside all names")
            while self._plainer(path, list(path.tied), path.tied):
                continue
            rest, refit = self.rest(path), self._refit(path.current, whole=True)
            while found := that_leads_instead(self.layout, path.groups, path.current, refit, rest):
                path.exchange(*found, tied=False)
                rest, refit = self.rest(path), self._refit(path.current, whole=True)
            lost = those_that_lose(self.layout, path.groups, path.current, refit, rest)
            path.steps, path.groups = without_lost(path.steps, path.groups, lost)

    def _ended(self, path: Path, null: Hypothesis, tried: Sequence[Hypothesis], whole: float) -> WithForce:
        """Return what was found; from here on free running counts again."""
        under_law = self.fits()
        path.current = current = under_law.closer(path.current)
        law = current.estimate.law
        assert law is not None
        return WithForce(
            path.steps,
            [[under_law.told(e) for e in group] for group in path.in_order],
            under_law.told(self._uncertain(path)),
            self.about(current.explanation, law),
            replace(current.estimate, law=in_newtons(law, current.explanation)),
            self._told(tried),
            whole,
            in_newtons(null.estimate.law, null.explanation),
            in_newtons(law, null.explanation),
            self.predicted(current),
            path.stands_out,
            path.explains,
            bool(path.chosen) and self.names.worsen(current, null),
        )

    def _uncertain(self, path: Path) -> FittedHypothesis:
        """Return the explanation that is answered, with what effects without a name would move in its standard errors."""
        current = path.current
        explanation = averaged(self.layout, current, path.not_named)
        if not path.chosen:
            return explanation
        about, free = self.about(explanation, current.estimate.law), self._free(path.chosen)
        with suppress(*UNSOLVED):
            moved = moved_by_unnamed(about, current.weighed, self._tested_beside(path), free)
            return widened(explanation, moved)
        return explanation

    def _refit(self, current: Hypothesis, *, whole: bool = False) -> Refit:
        """Return what fits all names but one, perhaps with a rival in its place; what was asked before is kept."""

        def refit(changes: Sequence[Change]) -> list[Hypothesis | None]:
            keys = [(id(current), name, id(rival), whole) for name, rival in changes]
            new = {k: change for k, change in zip(keys, changes, strict=True) if k not in self._refits}
            shared = self.layout, self.fits(), current, self.base, whole
            for key, at in zip(new, self.pool.run(_changed, shared, list(new.values())), strict=True):
                # Kept with what it came from: nothing else can have their places then.
                self._refits[key] = current, new[key][1], at
            return [self._refits[key][2] for key in keys]

        return refit

    def _fewer(self, path: Path, names: Sequence[str]) -> bool:
        """Go on without the name that the log needs least, where it needs it no longer; return whether there was one."""
        if names:
            self.say(f"asking whether each name is needed beside the others: {', '.join(names)}")
        found = no_longer_needed(names, path.current, self._refit(path.current))
        if found is not None:
            path.without(*found)
        return found is not None

    def _cheaper(self, path: Path, names: Sequence[str]) -> bool:
        """Go on without a further name that costs little in free running; return whether there was one."""
        found = costs_little(names, path.current, self._refit(path.current), self.names.pays)
        if found is not None:
            path.without(*found)
        return found is not None

    def _exchanged(self, path: Path, names: Sequence[str], rivals: Rivals) -> bool:
        """Go on with a rival that does better in the place of a name; return whether there was one.

        Those that do as well are told together with the name, which stays, and so are those that do better by less than
        the model is known to be wrong, unless they are the plainer cause. Of two names of which the log needs one the
        likelier stays: which of them went first was decided beside names that may be gone since.
        """
        while True:
            known = [n for n in self._passed(path) if n not in path.needless]
            able = {n: [e for e in of if e.effects[-1] not in known] for n, of in rivals.items()}
            open_to = [n for n in names if path.members(n) < GROUP]
            found = as_good_in_place(open_to, path.current, able, self._refit(path.current))
            if found is None:
                return self._plainer(path, open_to, able)
            name, other = found
            better = other.evidence - path.current.evidence
            plainer, name_again = other.name in effect_class(name).plainer, other.name in path.needless
            if better > 0.0 and (plainer or name_again or better > self.rest(path)):
                path.exchange(name, other, tied=better < ODDS)
                return True
            path.tie(name, other)

    def _plainer(self, path: Path, names: Sequence[str], rivals: Rivals) -> bool:
        """Go on with a plainer cause that explains nearly all of what a name does; return whether there was one."""
        changes = plainer_rivals(names, path.current, rivals)
        if not changes:
            return False
        found = nearly_in_place(changes, path.current, self._refit(path.current, whole=True), self.rest(path))
        if found is not None:
            path.exchange(*found, tied=True)
        return found is not None

    def _told(self, tried: Sequence[Hypothesis]) -> list[FittedHypothesis]:
        """Return explanations with their errors of free running, those aside whose free running grows without bound."""
        told = []
        for h in tried:
            with suppress(*UNSOLVED):
                told.append(self.fits().told(h.explanation))
        return told


def _to_ask(path: Path) -> list[str]:
    """Return the names to ask for again: all but the last one, and that one where what it acts beside may be gone."""
    return [n for n in path.chosen if n != path.chosen[-1] or effect_class(n).acts_with]


def _changed(
    shared: tuple[Layout, LawFits, Hypothesis, list[str], bool], change: Change
) -> Hypothesis | None:
    """Return all names with one left out, or a rival in its place, see `refitted`: a task of an executor."""
    layout, fits, current, base, whole = shared
    return refitted(layout, fits, current, base, *change, whole=whole)
