"""Levenberg-Marquardt on all parameters of a module at once, where they do not fall apart into small problems."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.func import functional_call, jacrev, vmap

CHUNK = 400  # samples whose Jacobian is held at once


@dataclass(frozen=True)
class JointFit:
    """How a joint fit went: mean squared residual, iterations, and why it stopped."""

    cost: float
    iterations: int
    stopped: str


def fit_jointly(
    module: nn.Module,
    parameters: Mapping[str, Tensor],
    samples: tuple[Tensor, ...],
    target: Tensor,
    scale: Tensor,
    *,
    max_iterations: int = 200,
    tolerance: float = 1e-3,
    window: int = 20,
    damping: float = 0.3,
    progress: Callable[[int, float], None] | None = None,
) -> JointFit:
    """Fit the parameters of a module so that module(*samples) comes nearest to the target.

    minimises mean over n, i of ((module(samples_n)_i - target_ni) / scale_i)^2

    The normal equations are summed over chunks of samples, whose Jacobian is found by automatic differentiation;
    the damping term and its rule are those of `least_squares.py`.

    Args:
        module: what is fitted; it ends with the best parameters found.
        parameters: those to fit, by their names in the module.
        samples: inputs, the first dimension of each counts the samples.
        target: (N, m).
        scale: (m,), positive.
        max_iterations: steps tried at most.
        tolerance: converged when the cost fell by less than this share
        window: within this many steps.
        damping: first value of mu.
        progress: called with iteration and cost.
    """
    names = list(parameters)
    shapes = [parameters[n].shape for n in names]
    sizes = [parameters[n].numel() for n in names]
    rest = {n: p.detach() for n, p in module.named_parameters() if n not in parameters}
    rest |= {n: b for n, b in module.named_buffers()}

    def named(theta: Tensor) -> dict[str, Tensor]:
        parts = theta.split(sizes)
        return {n: p.view(s) for n, p, s in zip(names, parts, shapes, strict=True)}

    def residual(theta: Tensor) -> Tensor:
        with torch.no_grad():
            return (functional_call(module, {**rest, **named(theta)}, samples) - target) / scale

    def one(theta: Tensor, *row: Tensor) -> Tensor:
        return functional_call(module, {**rest, **named(theta)}, row) / scale

    jacobian = vmap(jacrev(one), in_dims=(None, *(0,) * len(samples)))

    def normal(theta: Tensor, error: Tensor) -> tuple[Tensor, Tensor]:
        square, slope = theta.new_zeros(len(theta), len(theta)), theta.new_zeros(len(theta))
        for start in range(0, len(target), CHUNK):
            rows = slice(start, start + CHUNK)
            columns = jacobian(theta, *(s[rows] for s in samples)).detach().flatten(0, 1)
            square += columns.T @ columns
            slope += columns.T @ error[rows].flatten()
        return square, slope

    theta = torch.cat([parameters[n].detach().flatten() for n in names])
    error = residual(theta)
    cost = float(error.square().mean())
    mu, recent, stopped, iteration = damping, [cost], "iteration limit reached", 0
    square, slope = normal(theta, error)
    for iteration in range(1, max_iterations + 1):
        diagonal = square.diagonal()
        mean = diagonal.mean().clamp_min(1e-300)
        added = mu * (diagonal.clamp_min(1e-12 * mean) * mean).sqrt()
        factor, info = torch.linalg.cholesky_ex(square + torch.diag(added))
        step = -torch.cholesky_solve(slope[:, None], factor)[:, 0]
        new = residual(theta + step)
        new_cost = float(new.square().mean())
        predicted = -float(step @ (2.0 * slope + square @ step)) / error.numel()
        if int(info) == 0 and new_cost < cost:  # false for NaN too
            ratio = (cost - new_cost) / max(predicted, 1e-300)
            mu = max(mu * min(max(1.0 - (2.0 * ratio - 1.0) ** 3, 1.0 / 3.0), 2.0), 1e-15)
            theta, error, cost = theta + step, new, new_cost
            square, slope = normal(theta, error)
        else:
            mu *= 2.0
        recent.append(cost)
        if progress is not None:
            progress(iteration, cost)
        if mu > 1e10:
            stopped = "no step lowers the error"
            break
        if len(recent) > window and cost > recent[-1 - window] * (1.0 - tolerance):
            stopped = "converged: the error no longer falls"
            break
    with torch.no_grad():
        for name, value in named(theta).items():
            parameters[name].copy_(value)
    return JointFit(cost, iteration, stopped)
