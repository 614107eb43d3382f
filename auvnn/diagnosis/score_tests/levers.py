"""Effects that act on a lever: where they act is found from what they turn, without asking for one place after another.

A load at the place r lifts and turns: to first order in the load, all that it does is linear in the amounts m and in
the moments m r, in which the test at the null has no search. Asked for are the amounts with the levers at their nulls
and at one other value of each lever, all in one test: their span holds every place. The best place follows from the
same sums, and what is linear in the levers is at least what the effect at any one place takes away, so that the joint
test's p-value holds for it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.score_tests.probes import Probed
from auvnn.diagnosis.score_tests.score import Score, projection, score
from auvnn.effects import Extent, Parameter, effect_class
from auvnn.estimation.window_sums.statistics import Statistics

Array = NDArray[np.float64]
ARM = 0.5
"""At so many of its plausible scales each lever is asked for, beside its null."""
RIDGE = 1e-9


Shapes = dict[str, list[dict[str, float]]]


def lever_shapes(
    layout: Layout,
    names: Sequence[str],
    extent: Extent,
    starts_of: Mapping[str, Sequence[Mapping[str, float]]] | None = None,
) -> tuple[Shapes, Shapes]:
    """Return for each effect on levers its starts with the levers at their nulls, and with each in turn at another value.

    Args:
        layout: holds the effects.
        names: effects; those without levers are passed over.
        extent: of the log.
        starts_of: effect to shapes, the levers left out; by default the starts of the effect.
    """
    plain: Shapes = {}
    arms: Shapes = {}
    for name in names:
        kind, described = effect_class(name), layout.model.effect(name).parameters_of
        if not kind.levers:
            continue
        starts = (starts_of or {}).get(name) or kind.starts(described, extent)
        at = {p.name: p for p in described}
        null = {n: at[n].null for n in kind.levers}
        plain[name] = [{**start, **null} for start in starts]
        arms[name] = [
            {**start, **null, n: at[n].null + ARM * at[n].scale} for start in starts for n in kind.levers
        ]
    return plain, arms


@dataclass(frozen=True)
class OnLevers:
    """The joint test of an effect at one start, and the place that goes with it.

    Attributes:
        score: of amounts and moments together.
        shape: the start, with the levers at their best.
    """

    score: Score
    shape: dict[str, float]


def seen_on_levers(
    asked: Probed, sums: Statistics, base: Sequence[str], name: str, free: Sequence[str]
) -> list[OnLevers]:
    """Return the joint test at each start; see the module's text.

    Args:
        asked: the layout with stand-ins at the shapes of `lever_shapes`.
        sums: of the windows, at the null.
        base: effects that are free anyway.
        name: the effect.
        free: those of the base whose priors are wide.
    """
    kind, model = effect_class(name), asked.layout.model
    described = kind.describe(model.vehicle, model.actuation)
    joint, out = _joined(asked, name), []
    for label, start in asked.starts[name].items():
        found = score(sums, joint, base, label, free)
        place = _place(joint, sums, base, label, free, described)
        out.append(OnLevers(found, {**start, **place}))
    return out


def _joined(asked: Probed, name: str) -> Layout:
    """Return a layout that knows each stand-in and what acts on its levers as one."""
    layout = asked.layout
    columns, means = dict(layout.columns), dict(layout.means)
    for label in asked.labels(name):
        columns[label] = asked.joint_columns(label)
        # An amount is nought where the effect is absent.
        means[label] = np.concatenate([means[label], np.zeros(len(columns[label]) - len(means[label]))])
    return replace(layout, columns=columns, means=means)


def _place(
    layout: Layout,
    sums: Statistics,
    base: Sequence[str],
    label: str,
    free: Sequence[str],
    described: Sequence[Parameter],
) -> dict[str, float]:
    """Return the levers at which an effect takes away most, by what is linear in them.

    The slopes towards the amounts at the place r are those at the null plus, of each lever, the share r / arm of how
    much they change over the arm.
    """
    kind = effect_class(label.partition("@")[0])
    seen = projection(sums.total, sums.slope.sum(0), layout, base, label, free)
    live = [p for p in described if not p.shape]
    scale = np.array([p.scale for p in live])
    carried = np.array([p.name in kind.carried for p in live])
    arms = [p for n in kind.levers for p in described if p.name == n]
    each = np.concatenate([scale, np.tile(scale[carried], len(arms))])
    whole = seen.information + RIDGE * np.diag(each**-2)
    only = np.diag(scale)[carried]

    def lost(place: Array) -> float:
        share = place / ARM  # in plausible scales
        own = np.diag(np.where(carried, (1.0 - share.sum()) * scale, scale))
        turn = np.concatenate([own, np.kron(share[:, None], only)])
        right = turn.T @ seen.gradient
        return -float(right @ np.linalg.lstsq(turn.T @ whole @ turn, right, rcond=1e-12)[0])

    bounds = [((p.low - p.null) / p.scale, (p.high - p.null) / p.scale) for p in arms]
    corners = np.array(np.meshgrid(*[[-ARM, ARM]] * len(arms))).reshape(len(arms), -1).T
    begin = min([np.zeros(len(arms)), *corners], key=lost)
    best = minimize(lost, begin, method="Nelder-Mead", bounds=bounds, options={"xatol": 1e-3, "maxiter": 600})
    return {p.name: float(p.null + p.scale * x) for p, x in zip(arms, best.x, strict=True)}
