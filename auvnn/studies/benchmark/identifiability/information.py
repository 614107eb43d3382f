"""Which effects a log cannot tell from the hidden one, whoever looks: by its information, the truth being known.

At the truth the outputs change by S_h d when the hidden effect goes, d being its parameters less their nulls. Another
effect, moved by x, and the coefficients, moved by y within what is stated of them, make up for it as far as they can:

    distance^2 = min over x, y of |S_h d - S_r x - S_n y|^2 + y' P y,

every output in units of its noise, the initial state of each window free, and x within its bounds. Below 3.3 standard
errors nobody can tell the two apart by this log with 95 % confidence (`counting.TIED`), and a diagnosis that says so is
right. A coefficient group that is hidden may, in the other explanation, still be off by what was stated of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.stated_priors import FREE, Layout, lay_out
from auvnn.diagnosis.score_tests.probes import Probed, extent_of, probed
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_normal_equations import TRUST, linearise, motion, normal_equations
from auvnn.logs import Log
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.windows import CHANNELS, Windows
from auvnn.models import GreyBox
from auvnn.simulation.noise import make_noise

Array = NDArray[np.float64]
Values = Mapping[str, Mapping[str, float]]
# What the rival is called that adds nothing at all: below two the effect cannot even be seen.
NONE = "nothing"


@dataclass(frozen=True)
class Truth:
    """What is true of a log.

    Attributes:
        hidden: effects and their parameters.
        coefficients: factors of the drawn coefficients, by group.
    """

    hidden: Values
    coefficients: Values


@dataclass(frozen=True)
class Information:
    """The information that a log holds on effects and coefficients at the truth.

    Attributes:
        total: (P, P), initial states projected out.
        layout: whose columns these are; rivals with a shape stand in it as stand-ins.
        starts: effect to the names of its stand-ins.
        truth: of the log.
    """

    total: Array
    layout: Layout
    starts: Mapping[str, Sequence[str]]
    truth: Truth

    def distance(self, hidden: str, rival: str) -> float:
        """Return by how many standard errors the best imitation of a hidden effect by a rival misses it."""
        return min(self._distance(hidden, name) for name in self.starts.get(rival, [rival]))

    def _distance(self, hidden: str, rival: str) -> float:
        layout = self.layout
        mine = layout.columns[hidden]
        described = layout.described(hidden)
        away = np.array(
            [0.0 if p.shape else self.truth.hidden[hidden].get(p.name, p.null) - p.null for p in described]
        )
        free = [n for n in (rival, *self.truth.hidden) if n not in (NONE, hidden)]
        held = [n for n in layout.nuisance if n not in free]
        columns = np.concatenate([layout.of(free), layout.of(held)])
        precision, low, high = [np.zeros(0)], [np.zeros(0)], [np.zeros(0)]
        for name in free:
            parts = layout.described(name)
            precision.append(np.array([(FREE * p.scale) ** -2 for p in parts]))
            now = self._now(name)
            low.append(np.array([p.low for p in parts]) - now)
            high.append(np.array([p.high for p in parts]) - now)
        for name in held:
            size = len(layout.columns[name])
            spread = layout.spreads[name]
            precision.append(spread**-2.0)
            low.append(np.full(size, -np.inf))
            high.append(np.full(size, np.inf))
        inner = self.total[np.ix_(columns, columns)] + np.diag(np.concatenate(precision))
        gradient = self.total[np.ix_(columns, mine)] @ away
        step = NormalEquations(inner, gradient).bounded(np.concatenate(low), np.concatenate(high))
        whole = away @ self.total[np.ix_(mine, mine)] @ away
        return float(np.sqrt(max(whole - 2 * step @ gradient + step @ inner @ step, 0.0)))

    def _now(self, name: str) -> Array:
        described = self.layout.described(name)
        values = self.truth.hidden.get(name, {})
        return np.array([values.get(p.name, p.null) for p in described])


def noise_sigma(noise: str | Mapping[str, Any], windows: Windows) -> Array:
    """Return the noise of each channel, (18,), by the condition; infinite where it is not measured.

    Without noise, a channel is trusted as far as the diagnosis trusts it.
    """
    condition = make_noise(noise)
    absolute, relative = condition.sizes(CHANNELS)
    seen = windows.mask.sum((0, 1)).numpy() > 0
    move = motion(windows)
    size = (absolute + relative * move) / (np.sqrt(3.0) if condition.amplitude == "uniform" else 1.0)
    return np.where(seen, np.maximum(size, TRUST * move + 1e-9), np.inf)


@dataclass(frozen=True)
class TruthPoint:
    """A log cut into windows, and the truth as a model with every effect in it that is asked for.

    Attributes:
        probed: layout with stand-ins.
        windows: of the log.
        states: fitted initial states, (B, 13).
        sigma: noise, (18,).
        truth: of the log.
    """

    probed: Probed
    windows: Windows
    states: Tensor
    sigma: Array
    truth: Truth


def truth_point(
    model: GreyBox, log: Log, truth: Truth, rivals: Sequence[str], noise: str | Mapping[str, Any]
) -> TruthPoint:
    """Return where the information is asked for: the truth, with the rivals at their nulls.

    Args:
        model: nominal.
        log: whose windows are taken.
        truth: what is hidden, and the drawn coefficients.
        rivals: effects that might be taken for it.
        noise: condition: a name or its options.
    """
    names = list(dict.fromkeys([*truth.hidden, *rivals]))
    layout = lay_out(model, names)
    at = layout.model.rebuilt(layout.model.copied_effects())
    for name, values in {**truth.coefficients, **truth.hidden}.items():
        if name in layout.names:
            described = at.effect(name).parameters_of
            set_parameters(at, [name], np.array([values.get(p.name, p.null) for p in described]))
    layout = replace(layout, model=at)
    windows = windows_for(model, log)
    sigma = noise_sigma(noise, windows)
    states = initial_states(at, windows)
    for _ in range(2):
        _, change, _ = normal_equations(windows, linearise(at, windows, states, list(truth.hidden)), sigma)
        states = moved(states, torch.as_tensor(change))
    asked = probed(layout, [n for n in rivals if n not in truth.hidden], extent_of(windows))
    return TruthPoint(asked, windows, states, sigma, truth)


def information(point: TruthPoint) -> Information:
    """Return the information at a point, by the package's own equations."""
    asked = point.probed
    names = asked.layout.model.effect_names
    sums, _, _ = normal_equations(
        point.windows, linearise(asked.layout.model, point.windows, point.states, names), point.sigma
    )
    starts = {effect: list(found) for effect, found in asked.starts.items()}
    return Information(sums.hessian.sum(0), asked.layout, starts, point.truth)


def imitation(found: Information, rivals: Sequence[str]) -> dict[str, dict[str, float]]:
    """Return hidden effect to rival to distance in standard errors, "nothing" being no rival at all."""
    return {
        hidden: {
            rival: found.distance(hidden, rival)
            for rival in (NONE, *rivals)
            if rival not in found.truth.hidden
        }
        for hidden in found.truth.hidden
    }
