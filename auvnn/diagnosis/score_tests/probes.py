"""Effects of which the data say nothing at the null: asked for at several shapes, and corrected for the choice.

An onset, a frequency or a slack length has no meaning while the effect is absent, so the test is made at a few
values of it, each by a stand-in: the effect with its shape held and the rest free.

Reference: Davies (1987), Biometrika 74, for nuisance parameters that are present only under the alternative;
the correction here is Bonferroni's, which holds whatever the dependence.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.special import logsumexp
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, one_sided, shapes
from auvnn.diagnosis.score_tests.score import Score, score
from auvnn.effects import Body, Effect, Extent, Moment, Sensed, effect_class
from auvnn.estimation.linear_effects import LinearEffect
from auvnn.estimation.window_normal_equations import Statistics, linearise, normal_equations
from auvnn.metrics.windows import POSITION, Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]


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


class _One(nn.Module):
    """An effect as a function of its parameters."""

    def __init__(self, effect: Effect) -> None:
        super().__init__()
        self.effect = effect

    def forward(self, hook: str, *args: Any) -> Any:
        return getattr(self.effect, hook)(*args)


class StandIns(LinearEffect):
    """An effect at its null in several shapes at once, each with free parameters of its own.

    What the shapes do is added up, which is exact to first order at the null, and all that is asked for there.

    Args:
        kind: the effect's class.
        model: for which.
        shapes: values of the shape parameters, one mapping per stand-in.
        name: under which the model holds them.
    """

    HOOKS = ("thrust", "water", "body", "wrench", "sense")

    def __init__(
        self, kind: type[Effect], model: GreyBox, shapes: Sequence[Mapping[str, float]], name: str
    ) -> None:
        """Make the starting parameters, (S, live)."""
        nn.Module.__init__(self)
        every = [kind.build(model.vehicle, model.actuation, s) for s in shapes]
        self.one, described = _One(every[0]), every[0].parameters_of
        live = [i for i, p in enumerate(described) if not p.shape]
        self.name = name  # pyright: ignore[reportAttributeAccessIssue]
        self.excludes, self.time_varying = (), kind.time_varying  # pyright: ignore[reportAttributeAccessIssue]
        self.parameters_of = tuple(
            replace(described[i], name=f"{described[i].name}_{k}") for k in range(len(shapes)) for i in live
        )
        self._index = {p.name: i for i, p in enumerate(self.parameters_of)}
        start = torch.stack([e.theta.detach() for e in every])
        held = start.clone()
        held[:, live] = 0.0
        self.register_buffer("held", held, persistent=False)
        self.register_buffer("place", torch.eye(len(described), dtype=torch.float64)[live], persistent=False)
        self.register_buffer("start", start[:, live], persistent=False)
        self.theta = nn.Parameter(start[:, live].flatten())
        # The hooks that are not touched must cost nothing here either.
        self._touched = tuple(h for h in kind.hooks() if h in self.HOOKS)
        hooks = {h: getattr(StandIns, f"_{h}") for h in self._touched}
        made = type(f"{kind.__name__}StandIns", (StandIns,), hooks)
        self.__class__ = made  # pyright: ignore[reportAttributeAccessIssue]

    def _change(self, hook: str, args: Sequence[Any], pick: Callable[[Any], list[Tensor]]) -> list[Tensor]:
        """Return what all shapes together change of a hook's answer, to first order in the parameters.

        At the null an effect does nothing whatever the state, so that the state needs no derivative here; and
        the slopes by the few live parameters cost far less than those of all of an answer backwards.
        """
        start, place, args = self.get_buffer("start"), self.get_buffer("place"), list(map(_held, args))

        def one(values: Tensor, shape: Tensor) -> list[Tensor]:
            theta = shape + values @ place
            return pick(functional_call(self.one, {"effect.theta": theta}, (hook, *args)))

        return self.added(one, start, self.get_buffer("held"))

    def _thrust(self, thrust: Tensor, moment: Moment) -> Tensor:
        return thrust + self._change("thrust", (thrust, moment), lambda new: [new])[0]

    def _water(self, moment: Moment) -> tuple[Tensor, Tensor]:
        velocity, acceleration = self._change("water", (moment,), list)
        return velocity, acceleration

    def _wrench(self, moment: Moment, body: Body) -> Tensor:
        return self._change("wrench", (moment, body), lambda new: [new])[0]

    def _body(self, body: Body, moment: Moment | None) -> Body:
        # Where the weight acts must be said, for a change of it to be added.
        body = replace(body, weight_centre=body.hangs)
        # What the effect hands on untouched has no slope, and need not be asked for it.
        new = self.one("body", body, moment)
        names = [f.name for f in fields(body) if getattr(new, f.name) is not getattr(body, f.name)]
        more = self._change("body", (body, moment), lambda new: [getattr(new, n) for n in names])
        return replace(body, **{n: getattr(body, n) + m for n, m in zip(names, more, strict=True)})

    def _sense(self, sensed: Sensed) -> Sensed:
        names = [n for n in ("position", "quaternion", "nu", "nu_dot") if getattr(sensed, n) is not None]
        more = self._change("sense", (sensed,), lambda new: [getattr(new, n) for n in names])
        return replace(sensed, **{n: getattr(sensed, n) + m for n, m in zip(names, more, strict=True)})


def _held(value: Any) -> Any:
    """Return an argument of a hook through which nothing is differentiated."""
    if isinstance(value, Tensor):
        return value.detach()
    if is_dataclass(value) and not isinstance(value, type):
        held = {f.name: _held(getattr(value, f.name)) for f in fields(value) if f.init}
        return replace(value, **held)
    return value


@dataclass(frozen=True)
class Probed:
    """A layout in which stand-ins have taken the place of effects that have a shape.

    Attributes:
        layout: to be differentiated.
        starts: effect to its stand-ins' names and shapes.
        counts: effect to the number of shapes from which the best was chosen, where that is not that of `starts`.
    """

    layout: Layout
    starts: dict[str, dict[str, dict[str, float]]]
    counts: dict[str, int] = field(default_factory=dict)

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


def probed(
    layout: Layout,
    names: Sequence[str],
    extent: Extent,
    shapes_of: Mapping[str, list[dict[str, float]]] | None = None,
) -> Probed:
    """Put stand-ins in the place of those of the named effects whose shape has to be asked for.

    Args:
        layout: at a fit.
        names: effects that are asked for.
        extent: of the log.
        shapes_of: effect to the shapes to ask for; the effect's own starts by default.
    """
    model = layout.model
    starts: dict[str, dict[str, dict[str, float]]] = {}
    effects: list[Effect] = []
    columns: dict[str, NDArray[np.int64]] = {}
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
        shapes = (shapes_of or {}).get(name) or kind.starts(described, extent)
        # A clock that jitters begins a little before zero, where no time of an effect may be.
        bounds = {p.name: (p.low, p.high) for p in described}
        shapes = [{n: min(max(v, bounds[n][0]), bounds[n][1]) for n, v in shape.items()} for shape in shapes]
        effects.append(StandIns(kind, model, shapes, name))
        size = sum(not p.shape for p in described)
        starts[name] = {f"{name}@{k}": shape for k, shape in enumerate(shapes)}
        for label in starts[name]:
            columns[label] = np.arange(at, at + size)
            means[label] = np.array([p.null for p in described if not p.shape])
            at += size
    if not starts:
        return Probed(layout, {})
    whole = model.sharing(effects)
    return Probed(replace(layout, model=whole, names=tuple(columns), columns=columns, means=means), starts)
