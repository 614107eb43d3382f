"""All effects that remain, asked for at a fit: one linearisation, a test for each, a closer look where one is due."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.score_tests.levers import OnLevers, lever_shapes, seen_on_levers
from auvnn.diagnosis.score_tests.probes import Probed, extent_of, probed
from auvnn.diagnosis.score_tests.score import Score, similarity
from auvnn.diagnosis.score_tests.shape_search import ShapeSearch, best_of
from auvnn.diagnosis.score_tests.unexplained import is_somewhere, unexplained
from auvnn.diagnosis.selection.choose import ALPHA
from auvnn.effects import Extent, effect_class
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.kept_products import Wanted
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# How many times as much a shape between those that are tried may take away: part of its amplitude is out of phase.
HIDDEN = 3.0


@dataclass(frozen=True)
class Tested:
    """The tests of some effects at a fit.

    Attributes:
        scores: by effect.
        at: the layout at the fit.
        alike: entry (a, b) is how much of the first effect's trace the second one's can imitate, see `similarity`;
            empty where that was not asked for.
    """

    scores: dict[str, Score]
    at: Layout
    alike: Array

    @property
    def p_value(self) -> float:
        """Of all of them together."""
        return bonferroni([s.p_value for s in self.scores.values() if s.degrees])


class NullTests:
    """Tests at the null, of one log.

    Args:
        layout: stated values.
        windows: of the log.
        say: called with what is being done, in words.
    """

    def __init__(self, layout: Layout, windows: Windows, say: Callable[[str], None]) -> None:
        """Look how far the log reaches."""
        self.layout, self.windows, self.say = layout, windows, say
        self.extent = extent_of(windows)

    def __call__(
        self,
        current: FittedHypothesis,
        remaining: Sequence[str],
        base: Sequence[str],
        chosen: Sequence[str],
        alike: bool = False,
    ) -> Tested:
        """Test the effects that remain.

        The sums over all effects, the largest thing in a diagnosis, are gone when this returns.

        Args:
            current: the fit.
            remaining: effects that are asked for.
            base: effects that are free anyway.
            chosen: those of the base that were asked for, and found, before.
            alike: also say how much they look like one another.
        """
        left = unexplained(self.windows, current) if any(map(is_somewhere, remaining)) else None
        extent = replace(self.extent, left=left)
        sums, at, asked = self._statistics(current, remaining, base, extent, pairs=alike)
        asked_at = {n: asked.score(sums, base, n, chosen) for n in remaining}
        scores = {n: found for n, (found, _) in asked_at.items()}
        labels = [k for _, k in asked_at.values()] if alike else []
        matrix = similarity(sums, asked.layout, base, labels)
        # A stated coefficient that is set free takes what was stated of it away too: its gain is another matter.
        told = {n: s for n, s in scores.items() if s.degrees and n not in self.layout.nuisance}
        seen = {n: seen_on_levers(asked, sums, base, n, chosen) for n in told if effect_class(n).levers}
        del sums
        closer = ShapeSearch(at, self.windows, current, base, chosen, extent)
        return Tested(scores | self._closer(closer, told, seen), at, matrix)

    def _statistics(
        self,
        found: FittedHypothesis,
        remaining: Sequence[str],
        base: Sequence[str],
        extent: Extent,
        *,
        pairs: bool,
    ) -> tuple[Statistics, Layout, Probed]:
        """Linearise towards every parameter at a fit, those of the remaining effects at several shapes and levers."""
        model = self.layout.model.rebuilt(self.layout.model.copied_effects())
        set_parameters(model, found.names, found.fitted.theta)
        at = replace(self.layout, model=model)
        asked = probed(at, remaining, extent, *lever_shapes(at, remaining, extent))
        tested = [asked.joint_columns(label) for n in remaining for label in asked.labels(n)]
        sums, _, _ = normal_equations(
            self.windows,
            linearise(
                asked.layout.model, self.windows, found.fitted.initial, asked.layout.model.effect_names
            ),
            found.fitted.sigma,
            wanted=Wanted(asked.layout.of(base), tested, pairs),
        )
        return sums.finite(), at, asked

    def _closer(
        self, closer: ShapeSearch, told: dict[str, Score], seen: dict[str, list[OnLevers]]
    ) -> dict[str, Score]:
        """Return the scores of effects that were looked at more closely, by name.

        At its null place an effect on a lever shows what it lifts alone. Amounts and moments are asked for together,
        and where that takes away more of the errors than any other effect does, or than chance does where no effect is
        significant, place and time are worth finding: the errors that wrong ones leave count as noise in the test.

        Args:
            closer: who looks, at the fit.
            told: tests of the effects that count.
            seen: of those on levers, the joint tests at each of their starts.
        """
        found = self._nearer(closer, told)
        if not seen:
            return found
        joint = {n: best_of(on).score for n, on in seen.items()}
        by = {**told, **joint}
        promises = max(by, key=lambda n: by[n].gain - by[n].degrees)
        surest = max(by, key=lambda n: by[n].evidence)
        nothing = len(told) * min(s.p_value for s in told.values()) >= ALPHA
        for n in seen if nothing else {promises, surest} & {*seen}:
            # The best of several starts, among all effects.
            if chi2.sf(joint[n].gain, joint[n].degrees) * len(seen[n]) * len(told) >= ALPHA:
                continue
            self.say(f"looking at {n} more closely")
            best = closer.look(n, seen[n])
            if best is not None and best.p_value < told[n].p_value:
                found[n] = best
        return found

    def _nearer(self, closer: ShapeSearch, told: dict[str, Score]) -> dict[str, Score]:
        """Return the scores of effects without levers, of which closer looks around the best start say more.

        They are worth it where the best of all starts is beyond chance, among all effects, and takes away so much that
        the right shape may take away as much as any other effect does.

        Args:
            closer: who looks.
            told: tests of the effects that count.
        """
        found: dict[str, Score] = {}
        most = max((s.gain for s in told.values()), default=0.0)
        for n, plain in told.items():
            chance = plain.p_value * len(told) >= ALPHA
            if effect_class(n).levers or chance or plain.gain * HIDDEN < most:
                continue
            best = closer.near(n, plain)
            if best is not None and best.gain > plain.gain:
                found[n] = best
        return found


def bonferroni(p_values: list[float]) -> float:
    """Return one p-value for many dependent tests: Bonferroni's, which holds whatever the dependence."""
    return float(min(1.0, len(p_values) * min(p_values))) if p_values else 1.0
