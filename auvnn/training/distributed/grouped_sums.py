"""Sums over groups of samples: what makes a fit in memory and one spread over many workers the same to the last bit.

Rounding depends on the order in which numbers are added, and a fit of hundreds of iterations magnifies it. So every sum
of a fit is one of sums over groups of `GROUP` consecutive usable samples, counted over all runs and files, and the
groups' sums are added from the first to the last, wherever each of them was computed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import reduce
from operator import add
from typing import Any, TypeVar

import torch
from torch import Tensor

from auvnn.damping.base import DampingForm
from auvnn.damping.mlp import MLP
from auvnn.training.least_squares.forms import FormProblems, form_draw, size_of
from auvnn.training.least_squares.networks import NetworkProblems, Normal, Problems
from auvnn.training.least_squares.output_layers import RIDGE, draw_units, output_layers

GROUP = 32_768
T = TypeVar("T")
# Calls a method of every group's problems, and gives their answers in the order of the groups.
Ask = Callable[..., Iterator[Any]]


def slices(samples: int, size: int | None = None) -> list[slice]:
    """Return the groups of so many samples."""
    size = size or GROUP
    return [slice(k, min(k + size, samples)) for k in range(0, samples, size)]


def add_in_order(parts: Iterable[T]) -> T:
    """Return the sum of at least one, from the first to the last."""
    return reduce(add, parts)  # type: ignore[arg-type]


def add_all_in_order(parts: Iterable[tuple[Any, ...]]) -> tuple[Any, ...]:
    """Return the sums of tuples, place by place."""
    return reduce(lambda a, b: tuple(x + y for x, y in zip(a, b, strict=True)), parts)


def column_sums(values: Tensor) -> Tensor:
    """Return the sums over the samples (N, k), group by group, (k,)."""
    return add_in_order(values[part].sum(0) for part in slices(len(values)))


def problems_of(form: DampingForm, nu: Tensor, targets: Tensor, weights: Tensor | None) -> Problems:
    """Return the problems of a form on samples in memory.

    Args:
        form: the form.
        nu: scaled velocities (N, 6).
        targets: (m, N).
        weights: (m, N), or None for ones.
    """
    parts = slices(len(nu))
    if len(parts) <= 1:
        return group_problems(form, nu, targets, weights)
    groups = [
        group_problems(
            form,
            nu[p],
            targets[:, p].contiguous(),
            None if weights is None else weights[:, p].contiguous(),
            p.start,
        )
        for p in parts
    ]

    def ask(name: str, *values: Any) -> Iterator[Any]:
        return (getattr(group, name)(*values) for group in groups)

    return grouped(form, ask, len(nu), add_in_order(g.total for g in groups))


def group_problems(
    form: DampingForm, nu: Tensor, targets: Tensor, weights: Tensor | None, first: int = 0
) -> FormProblems | NetworkProblems:
    """Return the problems of a form on the samples of one group, of which the first is sample number `first`.

    Args:
        form: of the damping.
        nu: velocities, (N, 6), m/s and rad/s.
        targets: what the subnetworks should give, (N, 6).
        weights: of the samples, (N, 6), or None.
        first: number of the group's first sample.
    """
    if type(form) is not MLP:
        return FormProblems(form, nu, targets, weights)
    inputs = form.features(nu)
    return NetworkProblems(inputs, targets, weights, form.hidden, form.zero_at_rest, first=first)


def grouped(form: DampingForm, ask: Ask, samples: int, total: Tensor) -> Problems:
    """Return the problems of a form on the samples of many groups.

    Args:
        form: the form.
        ask: asks every group.
        samples: of all groups.
        total: (m,) sum of the weights.
    """
    return (_Networks if type(form) is MLP else _Forms)(form, ask, samples, total)


class _Grouped:
    inner_size: int
    outer_size: int

    def __init__(self, form: Any, ask: Ask, samples: int, total: Tensor) -> None:
        self.form, self.ask, self.samples, self.total = form, ask, samples, total
        self.members = len(form.axes)

    def cost(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the weighted mean of the squared residual (B,)."""
        return add_in_order(self.ask("squares", theta, beta, member)) / self.total[member]

    def normal(self, theta: Tensor, beta: Tensor, member: Tensor) -> Normal:
        """Return the normal equations at (theta, beta)."""
        return add_in_order(self.ask("normal", theta, beta, member))


class _Networks(_Grouped):
    def __init__(self, form: Any, ask: Ask, samples: int, total: Tensor) -> None:
        super().__init__(form, ask, samples, total)
        self.inner_size = form.hidden * 13
        self.outer_size = form.hidden + (0 if form.zero_at_rest else 1)

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw hidden layers that bend where the data is; see `NetworkProblems.draw`."""
        mean = add_in_order(self.ask("inputs_sum")) / self.samples
        covariance = add_in_order(self.ask("scatter", mean)) / self.samples
        return draw_units(
            self.members, self.form.hidden, self.samples, mean, covariance, self._inputs_at, generator
        )

    def _inputs_at(self, rows: Tensor) -> Tensor:
        return add_in_order(self.ask("inputs_at", rows))

    def solve_outer(self, theta: Tensor, member: Tensor) -> tuple[Tensor, Tensor]:
        """Return the best output layers (B, q) for given hidden layers, and the cost (B,)."""
        gram, right = add_all_in_order(self.ask("gram", theta, member))
        beta = output_layers(gram, right, RIDGE)
        return beta, self.cost(theta, beta, member)


class _Forms(_Grouped):
    outer_size = 0

    def __init__(self, form: DampingForm, ask: Ask, samples: int, total: Tensor) -> None:
        super().__init__(form, ask, samples, total)
        self.inner_size = size_of(form)

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw what the form itself draws."""
        return form_draw(self.form, generator)

    def solve_outer(self, theta: Tensor, member: Tensor) -> tuple[Tensor, Tensor]:
        """Return no outer parameters (B, 0), and the cost (B,)."""
        beta = theta.new_zeros(len(theta), 0)
        return beta, self.cost(theta, beta, member)
