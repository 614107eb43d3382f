"""The likelihood of a law of the stochastic force, its forces integrated out.

Forces and states are integrated out by the filter of `window_filter`, exactly where the windows are linear about a fit:
of each window only J^T e and J^T J are needed. Parameters that are free follow each law (their profile, with their
priors, within their bounds), so that the law need not be found again by fits.

References: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, chapter 5; Kristensen, Madsen and
Joergensen (2004), Automatica 40(2) 225-237, for likelihoods conditional on the past.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.diagnosis.noise_law.likelihood.bounded_minimum import bounded_minimum
from auvnn.diagnosis.noise_law.likelihood.force_smoother import Wave, moments, slope
from auvnn.diagnosis.noise_law.likelihood.law_information import law_information
from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums
from auvnn.diagnosis.noise_law.likelihood.window_filter import WindowFilter
from auvnn.estimation.nuisance_elimination import NormalEquations
from auvnn.estimation.window_sums.statistics import Statistics
from auvnn.metrics.force_law import ForceLaw

Array = NDArray[np.float64]
Index = NDArray[np.int64]
# Shares of the plausible force that are tried to begin with, and the correlation time, s.
STARTS, FIRST_TIME = np.logspace(-3.0, 1.0, 5), 1.0
# Standard deviations of the law's parameters as they are likely to be, in logarithms: a proper, weak prior.
VAGUE = 3.0
# Steps of the search for the likeliest law, and what one must promise of minus twice the log likelihood.
STEPS, PROMISED = 80, 0.01
# The same where explanations are compared, a hundredth of what decides between them: laws are found again at each fit.
ROUGHLY = 0.1


class Likelihood:
    """The likelihood of laws, of one explanation.

    Args:
        sums: of its windows.
    """

    def __init__(self, sums: ForceSums) -> None:
        """Take the parts apart."""
        self.sums, self.filter = sums, WindowFilter(sums)
        self._last: tuple[tuple[bytes, bytes], list[tuple[Index, Tensor, Tensor]]] | None = None
        self.prior = sums.priors.penalty(sums.theta) if len(sums.theta) else 0.0
        self.precision, self.pull = sums.priors.square, sums.priors.pull(sums.theta)

    def shown(self) -> list[int]:
        """Return the degrees of freedom in which a force would move anything that is measured.

        In a vertical plane with a measured attitude two of six do: of the others every likelihood ratio is one.
        """
        return [int(i) for i in np.flatnonzero(self.filter.seen.reshape(6, self.sums.cells).sum(-1) > 0.0)]

    def law(self, axes: Sequence[int], rms: Array, time: Array) -> ForceLaw:
        """Return a law with forces in some degrees of freedom.

        Args:
            axes: degrees of freedom with a force, 0 to 5.
            rms: of each of them, N and N m.
            time: correlation time of each of them, s.
        """
        full, times = np.zeros(6), np.ones(6)
        full[list(axes)], times[list(axes)] = rms, time
        return ForceLaw(full, times, self.sums.cell, self.sums.span, response=self.sums.response)

    def of(self, law: ForceLaw | None) -> tuple[float, Array, Array, float]:
        """Return minus twice the log likelihood, step, information, and what the step takes away of the value.

        Returns:
            value; step (P,) of the parameters within their reach; information (P, P); gain.
        """
        value, whole = self._whole(law)
        step, square, pull = self._followed(whole)
        gain = _gain(step, square + self.precision, pull)
        return value + float(whole[0, 0]) + self.prior - gain, step, square, gain

    def by_window(self, law: ForceLaw | None) -> Statistics:
        """Return the windows' sums towards the parameters, the forces of a law integrated out.

        The cost of a window is minus twice the logarithm of its likelihood, conditional on the windows before it, so that
        sums under different laws compare.
        """
        known = self.sums.known
        plain = self.sums.statistics.columns(list(range(known)))
        if not self._hidden(law):
            return plain
        hessian, slope, cost = plain.hessian.copy(), plain.slope.copy(), plain.cost.copy()
        for where, square, volume in self._under(law):
            hessian[where], slope[where] = square[:, 1:, 1:].numpy(), square[:, 0, 1:].numpy()
            cost[where] = (square[:, 0, 0] + volume).numpy()
        return replace(plain, hessian=hessian, slope=slope, cost=cost)

    def _whole(self, law: ForceLaw | None) -> tuple[float, Array]:
        """Return the sum of the log determinants, and that of the squares, (1 + P, 1 + P)."""
        if not self._hidden(law):
            return 0.0, self.filter.plain.sum(0).numpy()
        whole, value = torch.zeros_like(self.filter.plain[0]), 0.0
        for _, square, volume in self._under(law):
            whole, value = whole + square.sum(0), value + float(volume.sum())
        return value, whole.numpy()

    def _hidden(self, law: ForceLaw | None) -> bool:
        """Whether anything has to be integrated out: a force, or states that go from window to window."""
        return self.filter.free > 0 or (law is not None and bool(law.axes))

    def _under(self, law: ForceLaw | None) -> list[tuple[Index, Tensor, Tensor]]:
        """Return what the filter yields under a law; of the last law that was asked for it is known."""
        law = self.law([], np.zeros(0), np.zeros(0)) if law is None else law
        key = law.rms.tobytes(), law.time.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = key, list(self.filter.windows(law.axes, *_of(law)))
        return self._last[1]

    def _followed(self, whole: Array) -> tuple[Array, Array, Array]:
        """Return how the parameters that can move follow a law, their information, and their slope."""
        square, pull = whole[1:, 1:], whole[1:, 0] - self.pull
        if not len(pull):
            return pull, square, pull
        # What would go beyond a bound ends there, and the others follow.
        step = NormalEquations(square + self.precision, pull).bounded(*self.sums.reach)
        return step, square, pull

    def sloped(self, axes: Sequence[int], x: Array) -> tuple[float, Array]:
        """Return minus twice the log posterior of log rms and log time, (2 A,), and its gradient.

        At the parameters that follow a law the slope in them is zero: they are held while the law's is taken.
        """
        rms, time = np.exp(x[: len(axes)]), np.exp(x[len(axes) :])
        whole, volume, kept = torch.zeros_like(self.filter.plain[0]), 0.0, list[Wave]()
        for _, square, own in self.filter.windows(axes, torch.as_tensor(rms), torch.as_tensor(time), kept):
            whole, volume = whole + square.sum(0), volume + float(own.sum())
        plain = whole.numpy()
        step, square, pull = self._followed(plain)
        follow = torch.as_tensor(np.concatenate([[1.0], -step]))
        forces = moments(kept, follow, self.sums.cells)
        law = slope(forces, rms, time, self.sums.cells, self.sums.cell)
        away = x - self._likely(axes)
        value = volume + float(plain[0, 0]) + self.prior - _gain(step, square + self.precision, pull)
        return value + float(away @ away) / VAGUE**2, law + 2.0 * away / VAGUE**2

    def _likely(self, axes: Sequence[int]) -> Array:
        return np.concatenate([np.log(self.sums.sizes[list(axes)]), np.full(len(axes), np.log(FIRST_TIME))])

    def best(
        self, axes: Sequence[int], start: Array | None = None, most: int = STEPS, enough: float = PROMISED
    ) -> tuple[float, Array]:
        """Return the smallest value with forces in some degrees of freedom, and where: log rms and log time.

        Args:
            axes: degrees of freedom.
            start: to begin from, by default the best of a few sizes.
            most: steps of the search.
            enough: what a step must promise.
        """
        axes = list(axes)
        low = np.concatenate(
            [np.log(1e-4 * self.sums.sizes[axes]), np.full(len(axes), np.log(self.sums.times[0]))]
        )
        high = np.concatenate(
            [np.log(1e2 * self.sums.sizes[axes]), np.full(len(axes), np.log(self.sums.times[1]))]
        )
        start = np.clip(self._start(axes) if start is None else start, low, high)
        count = len(axes)
        shown = self._seen(axes)

        def curved(x: Array) -> Array:
            known = law_information(shown, self.sums.cell, np.exp(x[:count]), np.exp(x[count:]))
            return known + 2.0 / VAGUE**2 * np.eye(len(x))

        return bounded_minimum(partial(self.sloped, axes), curved, start, low, high, most=most, enough=enough)

    def _seen(self, axes: Sequence[int]) -> Array:
        """Return what windows say of the forces in some degrees of freedom, states integrated out, (B, A K, A K)."""
        known, size = self.sums.known, self.sums.cells
        places = known + np.concatenate([np.arange(i * size, (i + 1) * size) for i in axes])
        return self.sums.statistics.hessian[:, places[:, None], places]

    def _start(self, axes: list[int]) -> Array:
        """Return the best of a few sizes, one degree of freedom after the other."""
        time = float(np.clip(FIRST_TIME, *self.sums.times))
        sizes: dict[int, float] = {}
        for i in axes:
            tried = {}
            for share in STARTS:
                trial = {**sizes, i: share * self.sums.sizes[i]}
                order = sorted(trial)
                law = self.law(order, np.array([trial[k] for k in order]), np.full(len(order), time))
                tried[share] = self.of(law)[0]
            sizes[i] = min(tried, key=lambda s: tried[s]) * self.sums.sizes[i]
        return np.concatenate([np.log([sizes[i] for i in axes]), np.full(len(axes), np.log(time))])


def _gain(step: Array, normal: Array, pull: Array) -> float:
    """Return what a step takes away of twice the negative log likelihood."""
    return float(2.0 * pull @ step - step @ normal @ step)


def _of(law: ForceLaw) -> tuple[Tensor, Tensor]:
    return torch.as_tensor(law.rms[law.axes]), torch.as_tensor(law.time[law.axes])
