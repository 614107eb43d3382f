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
from auvnn.effects import Parameter, effect_class
from auvnn.estimation.window_sums.statistics import Statistics

Array = NDArray[np.float64]
ARM = 0.5
"""At so many of its plausible scales each lever is asked for, beside its null."""
RIDGE = 1e-9


def at_nulls(described: Sequence[Parameter], levers: Sequence[str]) -> dict[str, float]:
    """Return the levers at their nulls."""
    return {p.name: p.null for p in described if p.name in levers}


def arms(
    described: Sequence[Parameter], levers: Sequence[str], starts: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Return each start with each of the levers in turn at one other value than its null.

    Args:
        described: parameters of the effect.
        levers: names of those in which it is linear.
        starts: shapes, their levers left out.
    """
    null, at = at_nulls(described, levers), {p.name: p for p in described}
    return [{**start, **null, n: at[n].null + ARM * at[n].scale} for start in starts for n in levers]


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
        asked: the layout with stand-ins with their levers at their nulls, and those of `arms`.
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
        more = asked.turned[label]
        columns[label] = np.concatenate([columns[label], more])
        # An amount is nought where the effect is absent.
        means[label] = np.concatenate([means[label], np.zeros(len(more))])
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
