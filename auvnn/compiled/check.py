"""Compare compiled code with the torch functions it was made from, before anybody relies on it."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.compiled.kernel import Kernel
from auvnn.compiled.program import Numbers

RATE, GRADIENT = 1e-12, 1e-10
"""Largest difference, relative to the largest element of the same answer."""


def disagreement(
    kernel: Kernel,
    module: nn.Module,
    numbers: Numbers,
    samples: Mapping[str, Tensor],
    fixed: Tensor,
    batch: int,
) -> str:
    """Return in words how code and torch differ at random states and slightly other parameters; empty if they agree.

    Other values than those at tracing: what was taken for a constant and is none, shows.

    Args:
        kernel: the code.
        module: what it was made from.
        numbers: its parameters and buffers.
        samples: states "y" and inputs by name, (N, ...).
        fixed: places of the numbers that are part of the code.
        batch: for how many trajectories the code is that is to be checked.
    """
    generator = torch.Generator().manual_seed(3)
    found = ""
    # Where changed parameters leave what a function is defined on (a root), the true ones must do.
    for change in (1e-2, 0.0):
        row = numbers.row().detach()
        noise = torch.randn(row.shape, generator=generator, dtype=torch.float64)
        noise[fixed] = 0.0
        moved = row * (1.0 + change * noise) + 0.1 * change * noise * (row == 0.0)
        found, useful = _compare(kernel, module, numbers, samples, moved, batch)
        if found or useful:
            return found
    return "the right-hand side is not finite at random states: there is nothing to check compiled code by"


def _compare(
    kernel: Kernel,
    module: nn.Module,
    numbers: Numbers,
    samples: Mapping[str, Tensor],
    row: Tensor,
    batch: int,
) -> tuple[str, bool]:
    layout = kernel.layout
    values, place = {}, 0
    for name, tensor in zip(numbers.names, numbers.tensors, strict=True):
        part = row[place : place + tensor.numel()].reshape(tensor.shape).clone()
        values[name] = part.requires_grad_(kernel.gradient and name in numbers.wanted)
        place += tensor.numel()
    y = samples["y"].clone().requires_grad_(kernel.gradient)
    inputs = {
        n: samples[n].clone().requires_grad_(kernel.gradient) if s != 0 else None for n, s in layout.inputs
    }
    u = torch.cat([x.detach().reshape(len(y), -1) for x in inputs.values() if x is not None], dim=-1)
    with torch.set_grad_enabled(kernel.gradient):
        expected = functional_call(module, values, (y, *inputs.values()))
    scale = expected.detach()
    if not bool(torch.isfinite(scale).any()):
        return "", False
    words = difference("the right-hand side", kernel.rate(y, u, row, batch), expected.detach(), RATE)
    if words or not kernel.gradient:
        return words, True
    back = torch.linspace(-1.0, 1.0, expected.numel(), dtype=torch.float64).reshape(expected.shape)
    wanted = [values[n] for n in numbers.wanted]
    over = [y, *(x for n, x in inputs.items() if x is not None and n != layout.inputs[-1][0]), *wanted]
    slopes = (
        torch.autograd.grad(expected, over, back, allow_unused=True)
        if expected.requires_grad
        else [None] * len(over)
    )
    slopes = [torch.zeros_like(x) if g is None else g for x, g in zip(over, slopes, strict=True)]
    gy, gu, gp = kernel.rate_back(y.detach(), u, row, back, batch)
    inner = len(over) - len(wanted)
    by_input = torch.cat([g.reshape(len(y), -1) for g in slopes[1:inner]], dim=-1)
    by_number, at = [], 0
    for name, tensor in zip(numbers.names, numbers.tensors, strict=True):
        if name in numbers.wanted:
            by_number.append(gp[at : at + tensor.numel()])
        at += tensor.numel()
    pairs = [("state", gy, slopes[0]), ("inputs", gu[:, : by_input.shape[-1]], by_input)]
    if wanted:
        pairs += [
            (f"parameter {name}", mine, theirs.reshape(-1))
            for name, mine, theirs in zip(numbers.wanted, by_number, slopes[inner:], strict=True)
        ]
    for name, mine, theirs in pairs:
        words = difference(f"the gradient in the {name}", mine, theirs, GRADIENT)
        if words:
            return words, True
    return "", True


def difference(what: str, mine: Tensor, theirs: Tensor, tolerance: float) -> str:
    """Return in words how two answers differ, empty where they agree.

    Args:
        what: is compared, in words.
        mine: of compiled code.
        theirs: of torch.
        tolerance: relative to the largest element.
    """
    sound = torch.isfinite(theirs)
    if not torch.equal(sound, torch.isfinite(mine)):
        return f"compiled code and torch disagree on where {what} is finite"
    if not bool(sound.any()):
        return ""
    size = float(theirs[sound].abs().max())
    error = float((mine - theirs)[sound].abs().max())
    if error > tolerance * size + 1e-300:
        return f"compiled code and torch disagree on {what}: by {error:.2g} of {size:.2g}"
    return ""
