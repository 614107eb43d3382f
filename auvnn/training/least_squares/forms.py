"""Normal equations of any damping form by automatic differentiation."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor
from torch.func import functional_call, grad_and_value, vmap

from auvnn.damping.base import DampingForm
from auvnn.training.least_squares.networks import Normal


class FormProblems:
    """One least-squares problem for each degree of freedom of a damping form; all parameters are inner ones.

    Args:
        form: the form, whose parameters have the degrees of freedom first.
        nu: scaled velocities (N, 6).
        targets: (m, N) scaled damping, one row per axis of the form.
        weights: (m, N) of the squared residuals, or None for ones.
    """

    outer_size = 0

    def __init__(self, form: DampingForm, nu: Tensor, targets: Tensor, weights: Tensor | None) -> None:
        """Keep the data and split the form into its degrees of freedom."""
        self.nu, self.y, self.w = nu, targets, weights
        self.total = targets.new_full((len(targets),), float(len(nu))) if weights is None else weights.sum(1)
        self.members = len(form.axes)
        self._form = form
        self._single = [type(form)((axis,), **form.options()).to(nu) for axis in form.axes]
        self._shapes = {name: tensor.shape[1:] for name, tensor in form.named_parameters()}
        self._buffers = {name: tensor.detach().to(nu) for name, tensor in form.named_buffers()}
        self.inner_size = size_of(form)

    def draw(self, generator: torch.Generator) -> Tensor:
        """Draw what the form itself draws."""
        return form_draw(self._form, generator)

    def _output(self, theta: Tensor, nu: Tensor, member: int) -> Tensor:
        state = {name: tensor[member : member + 1] for name, tensor in self._buffers.items()}
        start = 0
        for name, shape in self._shapes.items():
            state[name] = theta[start : start + shape.numel()].view(1, *shape)
            start += shape.numel()
        return functional_call(self._single[member], state, (nu,))[..., 0]

    def _parts(self, member: Tensor) -> Iterator[tuple[int, Tensor, slice, Tensor, Tensor | None]]:
        size = 4096
        for number in torch.unique(member).tolist():
            rows = (member == number).nonzero()[:, 0]
            for start in range(0, len(self.nu), size):
                part = slice(start, start + size)
                weight = None if self.w is None else self.w[number, part]
                yield number, rows, part, self.y[number, part], weight

    def solve_outer(self, theta: Tensor, member: Tensor) -> tuple[Tensor, Tensor]:
        """Return no outer parameters (B, 0), and the cost (B,)."""
        beta = theta.new_zeros(len(theta), 0)
        return beta, self.cost(theta, beta, member)

    def cost(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the weighted mean of the squared residual (B,).

        Args:
            theta: parameters of B fits, (B, P).
            beta: not used: there is no output layer apart.
            member: degree of freedom that each fit is for, (B,).
        """
        return self.squares(theta, beta, member) / self.total[member]

    def squares(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor:
        """Return the weighted sum of the squared residual (B,).

        Args:
            theta: parameters of B fits, (B, P).
            beta: not used: there is no output layer apart.
            member: degree of freedom that each fit is for, (B,).
        """
        total = theta.new_zeros(len(theta))
        for number, rows, part, y, w in self._parts(member):
            output = vmap(lambda t, n=number, p=part: self._output(t, self.nu[p], n))(theta[rows])
            square = (output - y).square()
            total[rows] += (square if w is None else square * w).sum(1)
        return total

    def normal(self, theta: Tensor, beta: Tensor, member: Tensor) -> Normal:
        """Return the normal equations at theta.

        Args:
            theta: parameters of B fits, (B, P).
            beta: not used: there is no output layer apart.
            member: degree of freedom that each fit is for, (B,).
        """
        count, size = theta.shape
        inner, slope = theta.new_zeros(count, size, size), theta.new_zeros(count, size)
        for number, rows, part, y, w in self._parts(member):

            def output(t: Tensor, nu: Tensor, n: int = number) -> Tensor:
                return self._output(t, nu, n)

            # One gradient per sample: a network has many parameters and a single output.
            samples = vmap(grad_and_value(output), in_dims=(None, 0))
            jacobian, value = vmap(samples, in_dims=(0, None))(theta[rows], self.nu[part])
            residual = value - y
            weighted = jacobian if w is None else jacobian * w[:, None]
            inner[rows] += weighted.mT @ jacobian
            slope[rows] += (weighted.mT @ residual[..., None])[..., 0]
        empty = theta.new_zeros(count, size, 0)
        return Normal(inner, empty, theta.new_zeros(count, 0, 0), slope, theta.new_zeros(count, 0))


def size_of(form: DampingForm) -> int:
    """Return the number of parameters for one degree of freedom."""
    return sum(tensor.shape[1:].numel() for tensor in form.parameters())


def form_draw(form: DampingForm, generator: torch.Generator) -> Tensor:
    """Return the parameters (m, P) that a form itself would draw; it is left as it is."""
    saved = {name: tensor.detach().clone() for name, tensor in form.state_dict().items()}
    form.reset(generator)
    theta = pack(form)
    form.load_state_dict(saved)
    return theta


def pack(form: DampingForm) -> Tensor:
    """Return a form's parameters as rows (m, P), one row per degree of freedom, in float64."""
    return torch.cat([p.detach().cpu().double().reshape(len(p), -1) for p in form.parameters()], 1)


def unpack(form: DampingForm, theta: Tensor) -> None:
    """Write rows (m, P) into a form's parameters."""
    start = 0
    with torch.no_grad():
        for tensor in form.parameters():
            size = tensor[0].numel()
            tensor.copy_(theta[:, start : start + size].reshape(tensor.shape))
            start += size
