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
from auvnn.diagnosis.noise_law.hypothesis import (
    Hypothesis,
    WithForce,
    in_newtons,
)
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.noise_law.model_average import averaged
from auvnn.diagnosis.noise_law.rounds.beside_all_names import (
    Refit,
    Rivals,
    as_good_in_place,
    no_longer_needed,
    refitted,
    rivals_among,
    rivals_tried,
    those_that_lose,
    without_lost,
)
from auvnn.diagnosis.noise_law.rounds.name_after_name import NameAfterName
from auvnn.diagnosis.noise_law.rounds.path import Path
from auvnn.diagnosis.noise_law.under_law import NULL_STEPS
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]


class ForceSearch(NameAfterName):
    """The search together with a stochastic force, of one log.

    Args:
        asked: what is asked.
        windows: of the log, without a law.
        closed_loop: whether commands are known to answer the motion; else it is asked of the fit without any name.
    """

    def __init__(self, asked: Setting, windows: Windows, *, closed_loop: bool = False) -> None:
        """Begin without a law."""
        super().__init__(asked, windows, closed_loop=closed_loop)
        self._refits: dict[
            tuple[int, str, int, bool], tuple[Hypothesis, FittedHypothesis | None, Hypothesis | None]
        ] = {}

    def run(self, null: Hypothesis, fitted: Sequence[FittedHypothesis], most: int) -> WithForce:
        """Search for one effect after the other.

        Args:
            null: from `begin`.
            fitted: explanations of one effect that the first search has fitted.
            most: look for at most this many.
        """
        path = Path(null)
        tried, whole = self.names_after(path, null, fitted, most)
        self._to_the_end(path, null, rivals_among(tried, null), fitted, most)
        return self._ended(path, null, tried, whole)

    def from_names(
        self, named: Hypothesis, first: FittedHypothesis, before: State, most: int
    ) -> WithForce | None:
        """Go on from names that another search found; None where each is needed and has no rival that does as well.

        Args:
            named: from `begin`, with the names.
            first: the fit without any, over the same windows.
            before: where the search that found them ended.
            most: look for at most this many.
        """
        path = Path.of_names(self.fits().settled(named), before.steps)
        rivals, law = rivals_tried(path.chosen, before.tried), path.current.estimate.law
        changed = False
        while self._fewer(path, path.chosen) or self._exchanged(path, path.chosen, rivals):
            changed = True
        if law is None or not (changed or path.groups):
            return None
        null = self.fits().settled(self.judged(first, law), NULL_STEPS)
        if path.chosen:
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
        earlier = path.chosen[:-1]
        while self._fewer(path, earlier) or self._exchanged(path, earlier, rivals):
            self.names_after(path, null, fitted, most)
            earlier = path.chosen[:-1]
        if path.groups:
            self.say("comparing effects that could not be told apart, beside all names")
            rest = self.rest(path.current, path.chosen)
            refit = self._refit(path.current, whole=True)
            lost = those_that_lose(path.groups, path.current, refit, rest)
            path.steps, path.groups = without_lost(path.steps, path.groups, lost)

    def _ended(self, path: Path, null: Hypothesis, tried: Sequence[Hypothesis], whole: float) -> WithForce:
        """Return what was found; from here on free running counts again."""
        under_law, current, law = self.fits(), path.current, path.current.estimate.law
        assert law is not None
        return WithForce(
            path.steps,
            [[under_law.told(e) for e in group] for group in path.groups],
            under_law.told(averaged(self.layout, current, path.rivals)),
            self.about(current.explanation, law),
            replace(current.estimate, law=in_newtons(law, current.explanation)),
            self._told(tried),
            whole,
            in_newtons(null.estimate.law, null.explanation),
            self.predicted(current),
            path.stands_out,
            path.explains,
        )

    def _refit(self, current: Hypothesis, *, whole: bool = False) -> Refit:
        """Return what fits all names but one, perhaps with a rival in its place; what was asked before is kept."""

        def refit(name: str, rival: FittedHypothesis | None) -> Hypothesis | None:
            key = id(current), name, id(rival), whole
            if key not in self._refits:
                at = refitted(self.layout, self.fits(), current, self.base, name, rival, whole=whole)
                # Kept with what it came from: nothing else can have their places then.
                self._refits[key] = current, rival, at
            return self._refits[key][2]

        return refit

    def _fewer(self, path: Path, names: Sequence[str]) -> bool:
        """Go on without the name that the log needs least, where it needs it no longer; return whether there was one."""
        if names:
            self.say(f"asking whether each name is needed beside the others: {', '.join(names)}")
        found = no_longer_needed(names, path.current, self._refit(path.current))
        if found is not None:
            path.without(*found)
        return found is not None

    def _exchanged(self, path: Path, names: Sequence[str], rivals: Rivals) -> bool:
        """Go on with a rival that does better in the place of a name; return whether there was one.

        One that does as well is told together with the name.
        """
        known = {*path.dropped, *(e.effects[-1] for g in path.groups for e in g)}
        able = {n: [e for e in of if e.effects[-1] not in known] for n, of in rivals.items()}
        found = as_good_in_place(names, path.current, able, self._refit(path.current))
        if found is None:
            return False
        name, other = found
        better = other.evidence - path.current.evidence
        if better > 0.0:
            path.exchange(name, other, tied=better < ODDS)
        else:
            path.tie(name, other)
        return better > 0.0

    def _told(self, tried: Sequence[Hypothesis]) -> list[FittedHypothesis]:
        """Return explanations with their errors of free running, those aside whose free running grows without bound."""
        told = []
        for h in tried:
            with suppress(*UNSOLVED):
                told.append(self.fits().told(h.explanation))
        return told
