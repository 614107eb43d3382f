"""Effects of which the data say nothing at the null: asked for at several shapes, and corrected for the choice.

An onset, a frequency or a slack length has no meaning while the effect is absent, so the test is made at a few
values of it, each by a stand-in: the effect with its shape held and the rest free.

Reference: Davies (1987), Biometrika 74, for nuisance parameters that are present only under the alternative;
the correction here is Bonferroni's, which holds whatever the dependence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import logsumexp

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, one_sided, shapes
from auvnn.diagnosis.score_tests.score import Score, score
from auvnn.diagnosis.score_tests.stand_ins import StandIns
from auvnn.effects import Effect, Extent, Parameter, effect_class
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.windows import POSITION, Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
# Shapes among which a look at what is left of the acceleration chooses, at most: neighbours are as good as the same.
MANY = 100_000


def null_is_no_start(layout: Layout, name: str) -> bool:
    """Whether the fit of an effect must begin elsewhere than at its null: it has a shape, or one side only."""
    return bool(shapes(layout, name).any() or one_sided(layout, name).any())


def extent_of(windows: Windows) -> Extent:
    """Return how far a log reaches, by its windows."""
    times = windows.times[:, windows.warmup :]
    first, last = times[:, 0].numpy(), times[:, -1].numpy()
    own = [windows.run == run for run in np.unique(windows.run)]
    runs = tuple((float(first[mine].min()), float(last[mine].max())) for mine in own)
    longest = max(high - low for low, high in runs)
    seen = windows.mask[..., POSITION].all(-1)
    away = torch.linalg.vector_norm(windows.eta[..., :3], dim=-1)[seen].numpy()
    distance = (float(np.median(away)), float(away.max())) if len(away) else (0.0, 0.0)
    return Extent(float(first.min()), float(last.max() - first.min()), longest, distance, runs)


@dataclass(frozen=True)
class Probed:
    """A layout in which stand-ins have taken the place of effects that have a shape.

    Attributes:
        layout: to be differentiated.
        starts: effect to its stand-ins' names and shapes.
        counts: effect to the number of shapes from which the best was chosen, where that is not that of `starts`.
        turned: stand-in's name to the columns of what acts on its levers, lever by lever, each at another value.
    """

    layout: Layout
    starts: dict[str, dict[str, dict[str, float]]]
    counts: dict[str, int] = field(default_factory=dict)
    turned: dict[str, NDArray[np.int64]] = field(default_factory=dict)

    def score(
        self, statistics: Statistics, base: Sequence[str], name: str, free: Sequence[str]
    ) -> tuple[Score, str]:
        """Test an effect; return the score, and the name under which the layout knows it at its best.

        Args:
            statistics: sums of the windows at the null.
            base: effects that are free anyway.
            name: of the effect that is tested.
            free: effects whose priors are wide.
        """
        return self.best(name, lambda label: score(statistics, self.layout, base, label, free))

    def best(self, name: str, test: Callable[[str], Score]) -> tuple[Score, str]:
        """Return an effect's score at its best shape, and the name under which the layout knows that.

        Args:
            name: the effect.
            test: gives the score of one of `labels`.
        """
        if name not in self.starts:
            return test(name), name
        found = {s: test(s) for s in self.starts[name]}
        # The best shape is the likeliest; its own scores' variance says how sure it is, not which it is.
        best = max(found, key=lambda s: (found[s].degrees > 0, found[s].gain - found[s].degrees))
        return self._whole(name, found[best], self.starts[name][best], list(found.values())), best

    def seen(
        self, windows: Windows, at: FittedHypothesis, base: Sequence[str], name: str, free: Sequence[str]
    ) -> Score:
        """Return an effect's score at a fit, at the best of its shapes here.

        Args:
            windows: of the log.
            at: the fit at which the effect is tested.
            base: effects that are free anyway.
            name: of the effect that is tested.
            free: effects whose priors are wide.
        """
        return self.score(self.sums(windows, at), base, name, free)[0]

    def sums(self, windows: Windows, at: FittedHypothesis) -> Statistics:
        """Return the sums over the windows of a log at a fit, all parameters of the layout in them."""
        model = self.layout.model
        answered = linearise(model, windows, at.fitted.initial, model.effect_names)
        sums, _, _ = normal_equations(windows, answered, at.fitted.sigma)
        return sums.finite()

    def joint_columns(self, label: str) -> NDArray[np.int64]:
        """Return the columns of an effect or of one of its stand-ins, and of what acts on its levers."""
        own = self.layout.columns[label]
        return np.concatenate([own, self.turned[label]]) if label in self.turned else own

    def labels(self, name: str) -> list[str]:
        """Return under which names the layout knows an effect: its own, or those of its stand-ins."""
        return list(self.starts.get(name, [name]))

    def _whole(self, name: str, best: Score, shape: dict[str, float], all_of_them: list[Score]) -> Score:
        """Return the score of the effect, all parameters in it, corrected for having chosen the best shape."""
        seen = [s for s in all_of_them if s.degrees]
        kind = effect_class(name)
        model = self.layout.model
        described = kind.describe(model.vehicle, model.actuation)
        estimate = np.array([shape.get(p.name, p.null) for p in described])
        std = np.full(len(described), np.nan)
        live = np.array([not p.shape for p in described])
        estimate[live], std[live] = best.estimate, best.std
        if not seen:
            return replace(best, effect=name, estimate=estimate, std=std)
        count = self.counts.get(name, len(seen))
        p_value = min(1.0, count * min(s.p_value for s in seen))
        evidence = float(logsumexp([s.evidence for s in seen]) - np.log(count))
        return replace(best, effect=name, p_value=p_value, evidence=evidence, estimate=estimate, std=std)


def narrowed(layout: Layout, model: GreyBox) -> Layout:
    """Return the layout of a model with some of the effects."""
    columns, at = {}, 0
    for effect in model.members:
        columns[str(effect.name)] = np.arange(at, at + len(effect.parameters_of))
        at += len(effect.parameters_of)
    return replace(
        layout,
        model=model,
        names=tuple(columns),
        columns=columns,
        nuisance=tuple(n for n in layout.nuisance if n in columns),
        means={n: layout.means[n] for n in columns},
    )


def _within(described: Sequence[Parameter], shape: Mapping[str, float]) -> dict[str, float]:
    """Return a shape within its bounds: a clock that jitters begins a little before zero, where no time may be."""
    bounds = {p.name: (p.low, p.high) for p in described}
    return {n: min(max(v, bounds[n][0]), bounds[n][1]) for n, v in shape.items()}


def probed(
    layout: Layout,
    names: Sequence[str],
    extent: Extent,
    shapes_of: Mapping[str, list[dict[str, float]]] | None = None,
    arms_of: Mapping[str, list[dict[str, float]]] | None = None,
) -> Probed:
    """Put stand-ins in the place of those of the named effects whose shape has to be asked for.

    Args:
        layout: at a fit.
        names: effects that are asked for.
        extent: of the log.
        shapes_of: effect to the shapes to ask for; the effect's own starts by default.
        arms_of: effect to further shapes, as many for each of the former, at which what acts on its levers is asked for.
    """
    model = layout.model
    starts: dict[str, dict[str, dict[str, float]]] = {}
    counts: dict[str, int] = {}
    effects: list[Effect] = []
    columns: dict[str, NDArray[np.int64]] = {}
    turned: dict[str, NDArray[np.int64]] = {}
    means = dict(layout.means)
    at = 0
    for effect in model.members:
        name, described = str(effect.name), effect.parameters_of
        if name not in names or not any(p.shape for p in described):
            effects.append(effect)
            columns[name] = np.arange(at, at + len(described))
            at += len(described)
            continue
        kind = effect_class(name)
        given = (shapes_of or {}).get(name)
        shapes = given or kind.starts(described, extent)
        if given is None and extent.left is not None and shapes != kind.starts(described, extent.unseen()):
            counts[name] = MANY
        shapes = [_within(described, shape) for shape in shapes]
        effects.append(StandIns(kind, model, shapes, name))
        size = sum(not p.shape for p in described)
        starts[name] = {f"{name}@{k}": shape for k, shape in enumerate(shapes)}
        for label in starts[name]:
            columns[label] = np.arange(at, at + size)
            means[label] = np.array([p.null for p in described if not p.shape])
            at += size
        if arms := (arms_of or {}).get(name):
            arms = [_within(described, arm) for arm in arms]
            effects.append(StandIns(kind, model, arms, f"{name} on its levers", kind.carried))
            own = np.split(at + np.arange(len(arms) * len(kind.carried)), len(shapes))
            turned |= dict(zip(starts[name], own, strict=True))
            at += len(arms) * len(kind.carried)
    if not starts:
        return Probed(layout, {})
    whole = model.sharing(effects)
    asked = replace(layout, model=whole, names=tuple(columns), columns=columns, means=means)
    return Probed(asked, starts, counts, turned)
