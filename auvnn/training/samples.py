"""The samples of a fit in a bank's scaled numbers, and the sums over them that schemes ask for."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.damping.base import DampingForm
from auvnn.damping.polynomial import Polynomial
from auvnn.training.distributed.grouped_sums import add_all_in_order, problems_of, slices
from auvnn.training.least_squares.linear import merged, triangles
from auvnn.training.least_squares.networks import Problems

if TYPE_CHECKING:
    from auvnn.training.problem import DampingProblem


class SampleSums(Protocol):
    """What a fit may ask of its samples, in memory or not."""

    def problems(self, form: DampingForm) -> Problems:
        """Return the least-squares problems of a form."""
        ...

    def triangles(self, form: Polynomial) -> NDArray[np.float64]:
        """Return what the samples say about the coefficients of a polynomial; see `linear.triangles`."""
        ...

    def error_sums(self, bank: DampingBank) -> tuple[Tensor, Tensor]:
        """Return the sums of the weighted squared error of a bank, and of the weights, (6,) each."""
        ...


@dataclass(frozen=True)
class Samples:
    """A problem in the bank's scaled numbers, (N, 6) each."""

    nu: Tensor
    target: Tensor
    weight: Tensor

    @classmethod
    def scaled(cls, problem: DampingProblem, bank: DampingBank) -> Samples:
        """Divide a problem by the bank's scales."""
        inputs, outputs = bank.input_scale.cpu().double(), bank.output_scale.cpu().double()
        return cls(problem.nu / inputs, problem.target / outputs, problem.weights)

    def rows(self, axes: tuple[int, ...]) -> tuple[Tensor, Tensor | None]:
        """Return targets and weights (m, N) of some axes; weights None where all samples count the same."""
        weight = self.weight.T[list(axes)].contiguous()
        same = bool((weight == weight[:, :1]).all()) and bool((weight > 0).all())
        return self.target.T[list(axes)].contiguous(), None if same else weight

    def groups(self) -> Iterator[Samples]:
        """Yield the groups of which all sums are made; see `training.groups`."""
        return (Samples(self.nu[p], self.target[p], self.weight[p]) for p in slices(len(self.nu)))

    def problems(self, form: DampingForm) -> Problems:
        """Return the least-squares problems of a form."""
        return problems_of(form, self.nu, *self.rows(form.axes))

    def triangles(self, form: Polynomial) -> NDArray[np.float64]:
        """Return what the samples say about the coefficients of a polynomial; see `linear.triangles`."""
        return reduce(merged, (triangles(form, g.nu, *g.rows(form.axes)) for g in self.groups()))

    def error_sums(self, bank: DampingBank) -> tuple[Tensor, Tensor]:
        """Return the sums of the weighted squared error of a bank, and of the weights, (6,) each."""
        return add_all_in_order(error_sums(bank, group) for group in self.groups())


def error_sums(bank: DampingBank, samples: Samples) -> tuple[Tensor, Tensor]:
    """Return what `Samples.error_sums` does, all samples at once."""
    like = bank.input_scale
    with torch.no_grad():
        scaled = bank(samples.nu.to(like) * bank.input_scale) / bank.output_scale
    residual = scaled.cpu().double() - samples.target
    return (samples.weight * residual.square()).sum(0), samples.weight.sum(0)
