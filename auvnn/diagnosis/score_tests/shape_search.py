"""A closer look at effects with shapes: where a load hangs, when it was taken, the frequency of a wave between others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, initial_guess
from auvnn.diagnosis.score_tests.levers import OnLevers, lever_shapes, seen_on_levers
from auvnn.diagnosis.score_tests.probes import MANY, Probed, extent_of, narrowed, null_is_no_start, probed
from auvnn.diagnosis.score_tests.score import Score
from auvnn.diagnosis.score_tests.unexplained import is_somewhere, unexplained
from auvnn.effects import Extent, effect_class
from auvnn.estimation.priors import set_parameters
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ShapeSearch:
    """Looks at one effect after the other, at a fit.

    Attributes:
        layout: at the fit.
        windows: of the log.
        found: the fit.
        base: effects that are free beside the one that is asked for; all others are left out.
        free: those of the base that were asked for, and found, before.
        extent: of the log.
    """

    layout: Layout
    windows: Windows
    found: FittedHypothesis
    base: Sequence[str]
    free: Sequence[str]
    extent: Extent

    def on_levers(self, name: str, starts: Sequence[Mapping[str, float]] | None = None) -> list[OnLevers]:
        """Return the joint tests of an effect's amounts and of what they turn, at each of its starts, see `levers`.

        Args:
            name: the effect.
            starts: shapes, the levers left out; those of the effect where None.
        """
        if not effect_class(name).levers:
            return []
        beside = self._beside(name)
        given = None if starts is None else {name: starts}
        asked = probed(beside, [name], self.extent, *lever_shapes(beside, [name], self.extent, given))
        return seen_on_levers(asked, asked.sums(self.windows, self.found), self.base, name, self.free)

    def look(self, name: str, seen: Sequence[OnLevers] = ()) -> Score | None:
        """Return an effect's score by a closer look, the place from what it turns, then the time; None if there is none.

        The score is that at one place and time; what it must stand against is that of all places together.

        Args:
            name: the effect.
            seen: what `on_levers` has returned, where that has been asked already.
        """
        seen = seen or self.on_levers(name)
        if not seen:
            return None
        looks, counted = self.around(name, best_of(seen).shape, len(seen))
        shape = self._shape(name, _best(looks).estimate) if looks else best_of(seen).shape
        levers = effect_class(name).levers
        again = self.on_levers(name, [{n: v for n, v in shape.items() if n not in levers}])
        joint = best_of([*seen, *again])
        looks.append(self._seen(probed(self._beside(name), [name], self.extent, {name: [joint.shape]}), name))
        p_values = [len(seen) * min(s.score.p_value for s in seen), counted * again[0].score.p_value]
        return replace(
            _best(looks),
            p_value=min(1.0, *p_values),
            statistic=joint.score.statistic,
            degrees=joint.score.degrees,
            inflation=joint.score.inflation,
            evidence=joint.score.evidence - float(np.log(counted)),
        )

    def around(
        self, name: str, shape: Mapping[str, float], counted: int, plain: Sequence[Score] = ()
    ) -> tuple[list[Score], int]:
        """Return an effect's scores around a shape, by levels, and among how many shapes the last was chosen.

        Each level looks around the best that has been found before.

        Args:
            name: the effect.
            shape: its shape parameters.
            counted: among how many shapes this one was chosen.
            plain: its scores at that shape, where the next look is around it if no other is better.
        """
        kind, described = effect_class(name), self.layout.model.effect(name).parameters_of
        at, looks, near = self._beside(name), [], dict(shape)
        while around := kind.closest(described, self.extent, near, len(looks)):
            # All that might have been asked for counts: which it is depends on what was found before.
            counted *= 1 + len(around)
            asked = replace(probed(at, [name], self.extent, {name: around}), counts={name: counted})
            looks.append(self._seen(asked, name))
            near = self._shape(name, _best([*plain, *looks]).estimate)
        return looks, counted

    def near(self, name: str, plain: Score) -> Score | None:
        """Return the score of an effect without levers by closer looks around its best start; None where it has none.

        Args:
            name: the effect.
            plain: its score at the best of its starts.
        """
        kind, described = effect_class(name), self.layout.model.effect(name).parameters_of
        shape = self._shape(name, plain.estimate)
        if not kind.closest(described, self.extent, shape, 0):
            return None
        counted = MANY if self.extent.left is not None else len(kind.starts(described, self.extent))
        looks, _ = self.around(name, shape, counted, [plain])
        best = _best([plain, *looks])
        # What the starts alone say stays true: one of two answers is chosen.
        sure, likely = min(plain.p_value, best.p_value), max(plain.evidence, best.evidence)
        paid = replace(best, p_value=min(1.0, 2.0 * sure), evidence=likely - float(np.log(2.0)))
        return paid if best is not plain else plain

    def start(self, name: str) -> Layout:
        """Return the layout at the fit, the effect set to the best of its shapes.

        Whoever asks for one effect by name is answered by a closer look where there is one.
        """
        plain = self._seen(probed(self.layout, [name], self.extent), name)
        closer = self.look(name) if effect_class(name).levers else self.near(name, plain)
        best = _best([plain] if closer is None else [plain, closer])
        model = self.layout.model.rebuilt(self.layout.model.copied_effects())
        set_parameters(model, [name], initial_guess(self.layout, name, best.estimate))
        return replace(self.layout, model=model)

    def _seen(self, asked: Probed, name: str) -> Score:
        return asked.seen(self.windows, self.found, self.base, name, self.free)

    def _shape(self, name: str, values: Array) -> dict[str, float]:
        described = self.layout.model.effect(name).parameters_of
        return {p.name: float(v) for p, v in zip(described, values, strict=True) if p.shape}

    def _beside(self, name: str) -> Layout:
        """Return the layout without effects that are neither asked for nor free."""
        kept = [e for e in self.layout.model.copied_effects() if str(e.name) in (*self.base, name)]
        return narrowed(self.layout, self.layout.model.rebuilt(kept))


def search_shapes(
    layout: Layout, windows: Windows, found: FittedHypothesis, base: Sequence[str], name: str = ""
) -> ShapeSearch:
    """Return who looks closer at effects that a fit does not hold yet.

    Args:
        layout: stated values.
        windows: of the log.
        found: the fit.
        base: effects that were free in it whatever was asked for.
        name: of the effect that will be looked at, where that is known.
    """
    model = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(model, found.names, found.fitted.theta)
    held = [*base, *(e for e in found.effects if e not in base)]
    extent = extent_of(windows)
    if is_somewhere(name):
        extent = replace(extent, left=unexplained(windows, found))
    return ShapeSearch(replace(layout, model=model), windows, found, held, found.effects, extent)


def searched_start(
    layout: Layout, windows: Windows, found: FittedHypothesis, base: Sequence[str], name: str
) -> Layout | None:
    """Return where the fit of one more effect begins if its null is no place to begin: at the best of its shapes.

    Args:
        layout: stated values.
        windows: of the log.
        found: the fit without the effect.
        base: effects that were free in it whatever was asked for.
        name: the effect.

    Returns:
        the layout with its values; None where the fit may begin at the null.
    """
    if not null_is_no_start(layout, name):
        return None
    # One that the model has is among those that are uncertain anyway: here it is the one that is asked for.
    others = [n for n in base if n != name]
    return search_shapes(layout, windows, found, others, name).start(name)


def best_of(seen: Sequence[OnLevers]) -> OnLevers:
    """Return the start at which amounts and moments together take away most."""
    return max(seen, key=lambda one: one.score.gain - one.score.degrees)


def _best(looks: Sequence[Score]) -> Score:
    return max(looks, key=lambda s: s.gain - s.degrees)
