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
from auvnn.estimation.window_normal_equations import Statistics

Array = NDArray[np.float64]
ARM = 0.5
"""At so many of its plausible scales each lever is asked for, beside its null."""
RIDGE = 1e-9


def with_levers(
    described: Sequence[Parameter], levers: Sequence[str], starts: Sequence[Mapping[str, float]]
) -> list[dict[str, float]]:
    """Return each start with the levers at their nulls, and with each of them at one other value.

    Args:
        described: parameters of the effect.
        levers: names of those in which it is linear.
        starts: shapes, their levers left out.
    """
    at = {p.name: p for p in described}
    null = {n: at[n].null for n in levers}
    arms = [{}, *({n: at[n].null + ARM * at[n].scale} for n in levers)]
    return [{**start, **null, **arm} for start in starts for arm in arms]


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
        asked: the layout with stand-ins at the shapes that `with_levers` gives.
        sums: of the windows, at the null.
        base: effects that are free anyway.
        name: the effect.
        free: those of the base whose priors are wide.
    """
    kind, model = effect_class(name), asked.layout.model
    described = kind.describe(model.vehicle, model.actuation)
    levers = kind.levers
    labels, size = asked.labels(name), 1 + len(levers)
    joint = _joined(asked.layout, name, labels, size)
    out = []
    for k in range(len(labels) // size):
        label = f"{name}@{k}"
        start = asked.starts[name][labels[size * k]]
        found = score(sums, joint, base, label, free)
        place = _place(joint, sums, base, label, free, described, levers)
        out.append(OnLevers(found, {**start, **place}))
    return out


def _joined(layout: Layout, name: str, labels: Sequence[str], size: int) -> Layout:
    """Return a layout that knows `size` stand-ins after one another as one."""
    columns = {n: c for n, c in layout.columns.items() if n not in labels}
    means = {n: m for n, m in layout.means.items() if n not in labels}
    for k in range(len(labels) // size):
        mine = labels[size * k : size * (k + 1)]
        columns[f"{name}@{k}"] = np.concatenate([layout.columns[n] for n in mine])
        means[f"{name}@{k}"] = np.concatenate([layout.means[n] for n in mine])
    return replace(layout, names=tuple(columns), columns=columns, means=means)


def _place(
    layout: Layout,
    sums: Statistics,
    base: Sequence[str],
    label: str,
    free: Sequence[str],
    described: Sequence[Parameter],
    levers: Sequence[str],
) -> dict[str, float]:
    """Return the levers at which an effect takes away most, by what is linear in them.

    The slopes towards the amounts at the place r are those at the null plus, of each lever, the share r / arm of how
    much they change over the arm.
    """
    seen = projection(sums.total, sums.slope.sum(0), layout, base, label, free)
    live = [p for p in described if not p.shape]
    scale = np.array([p.scale for p in live])
    arms = [p for n in levers for p in described if p.name == n]
    whole = seen.information + RIDGE * np.diag(np.tile(scale**-2, 1 + len(arms)))

    def lost(place: Array) -> float:
        share = place / ARM  # in plausible scales
        turn = np.kron(np.append(1.0 - share.sum(), share)[:, None], np.diag(scale))
        right = turn.T @ seen.gradient
        return -float(right @ np.linalg.lstsq(turn.T @ whole @ turn, right, rcond=1e-12)[0])

    bounds = [((p.low - p.null) / p.scale, (p.high - p.null) / p.scale) for p in arms]
    corners = np.array(np.meshgrid(*[[-ARM, ARM]] * len(arms))).reshape(len(arms), -1).T
    begin = min([np.zeros(len(arms)), *corners], key=lost)
    best = minimize(lost, begin, method="Nelder-Mead", bounds=bounds, options={"xatol": 1e-3, "maxiter": 600})
    return {p.name: float(p.null + p.scale * x) for p, x in zip(arms, best.x, strict=True)}
