"""A closer look at effects of more shapes than can always be asked for: an onset, and where the load hangs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, initial_guess
from auvnn.diagnosis.score_tests.probes import Probed, extent_of, narrowed, null_is_no_start, probed
from auvnn.diagnosis.score_tests.score import Score
from auvnn.effects import Extent, effect_class
from auvnn.estimation.priors import set_parameters
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# Starts around which that is done at a time: this bounds the memory.
NEARER = 2


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

    def due(self, name: str) -> bool:
        """Return whether there is a closer look at an effect."""
        kind, described = effect_class(name), self.layout.model.effect(name).parameters_of
        return any(
            kind.closer(described, self.extent, shape) for shape in kind.starts(described, self.extent)
        )

    def nearer(self, name: str) -> list[Probed]:
        """Return the closer looks at an effect, each around some of its starts; an empty list where it has none.

        Around all of them: which of the starts is best says little while what lies between them is what counts.
        """
        described = self.layout.model.effect(name).parameters_of
        kind = effect_class(name)
        closer = [kind.closer(described, self.extent, shape) for shape in kind.starts(described, self.extent)]
        at, whole = self._beside(name), {name: sum(map(len, closer))}
        groups = [[s for some in closer[k : k + NEARER] for s in some] for k in range(0, len(closer), NEARER)]
        return [replace(probed(at, [name], self.extent, {name: g}), counts=whole) for g in groups if g]

    def look(self, name: str) -> Score | None:
        """Return an effect's score by a closer look, and closer still around the best; None where there is none."""
        asked = self.nearer(name)
        if not asked:
            return None
        looks = [self._seen(each, name) for each in asked]
        looks += self.around(name, self._shape(name, _best(looks).estimate), asked[0].counts[name])
        return replace(_best(looks), p_value=min(s.p_value for s in looks))

    def around(self, name: str, shape: Mapping[str, float], counted: int) -> list[Score]:
        """Return an effect's scores around a shape, each level of the look around the best that the last has found.

        Args:
            name: the effect.
            shape: its shape parameters.
            counted: among how many shapes this one was chosen.
        """
        kind, described = effect_class(name), self.layout.model.effect(name).parameters_of
        at, looks, near = self._beside(name), [], dict(shape)
        while around := kind.closest(described, self.extent, near, len(looks)):
            # All that might have been asked for counts: which it is depends on what was found before.
            counted *= 1 + len(around)
            asked = replace(probed(at, [name], self.extent, {name: around}), counts={name: counted})
            looks.append(self._seen(asked, name))
            near = self._shape(name, _best(looks).estimate)
        return looks

    def start(self, name: str) -> Layout:
        """Return the layout at the fit, the effect set to the best of its shapes.

        Whoever asks for one effect by name is answered by a closer look where there is one.
        """
        plain, closer = self._seen(probed(self.layout, [name], self.extent), name), self.look(name)
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
    layout: Layout, windows: Windows, found: FittedHypothesis, base: Sequence[str]
) -> ShapeSearch:
    """Return who looks closer at effects that a fit does not hold yet.

    Args:
        layout: stated values.
        windows: of the log.
        found: the fit.
        base: effects that were free in it whatever was asked for.
    """
    model = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(model, found.names, found.fitted.theta)
    held = [*base, *(e for e in found.effects if e not in base)]
    return ShapeSearch(replace(layout, model=model), windows, found, held, found.effects, extent_of(windows))


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
    return search_shapes(layout, windows, found, base).start(name)


def _best(looks: Sequence[Score]) -> Score:
    return max(looks, key=lambda s: s.gain - s.degrees)
