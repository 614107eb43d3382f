"""Trace a right-hand side, and its vector-Jacobian product, into scalar operations."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.func import functional_call

from auvnn.compiled.recorder import CannotCompile, Recorder
from auvnn.compiled.rules import apply
from auvnn.compiled.scalars import Scalars

LARGEST = 40_000
"""Scalar operations beyond which nothing is compiled: the code is unrolled, and compilers take minutes for more."""


@dataclass(frozen=True)
class Layout:
    """What a right-hand side is a function of, besides its parameters.

    Attributes:
        state: size of the state y.
        inputs: name and size of each input, in order; size None for a plain number. The first is the one that may
            change within a step, the last is the time.
    """

    state: int
    inputs: tuple[tuple[str, int | None], ...]

    @property
    def width(self) -> int:
        """Numbers that all inputs have together."""
        return sum(1 if size is None else size for _, size in self.inputs)


@dataclass(frozen=True)
class Numbers:
    """The parameters and buffers of a module as one row of numbers.

    Attributes:
        names: of parameters and buffers, in order.
        tensors: the same.
        wanted: names of those whose gradient is asked for.
    """

    names: tuple[str, ...]
    tensors: tuple[Tensor, ...]
    wanted: tuple[str, ...]

    @staticmethod
    def of(module: nn.Module) -> Numbers:
        """Collect the numbers of a module.

        Raises:
            CannotCompile: some are not double precision on the CPU.
        """
        found = {**dict(module.named_parameters()), **dict(module.named_buffers())}
        for name, tensor in found.items():
            if tensor.dtype != torch.float64 or tensor.device.type != "cpu":
                kind = str(tensor.dtype).removeprefix("torch.")
                raise CannotCompile(f"{name} is {kind} on {tensor.device}: only double precision on the CPU")
        return Numbers(
            tuple(found), tuple(found.values()), tuple(n for n, t in found.items() if t.requires_grad)
        )

    def row(self) -> Tensor:
        """Return all numbers in one row, as a function of the tensors."""
        if not self.tensors:
            return torch.zeros(0, dtype=torch.float64)
        return torch.cat([t.reshape(-1) for t in self.tensors])

    def fixed(self) -> Tensor:
        """Return which numbers of the row are no parameters and exactly 0, 1 or -1: they go into the code."""
        parts = []
        for name, tensor in zip(self.names, self.tensors, strict=True):
            flat = tensor.detach().reshape(-1)
            plain = (flat == 0.0) | (flat.abs() == 1.0)
            # A parameter changes: its code would be compiled again whenever it reaches zero.
            parts.append(
                plain if not isinstance(tensor, nn.Parameter) and name not in self.wanted else plain & False
            )
        return torch.cat(parts) if parts else torch.zeros(0, dtype=torch.bool)


@dataclass(frozen=True)
class Program:
    """A traced function.

    Attributes:
        scalars: the graph.
        rate: nodes of the derivative.
        state_gradient: nodes of the product of a cotangent with the Jacobian in the state; empty without gradient.
        input_gradient: the same for the inputs.
        parameter_gradient: (place in the row of numbers, node) of those that are not zero.
    """

    scalars: Scalars
    rate: tuple[int, ...]
    state_gradient: tuple[int, ...] = ()
    input_gradient: tuple[int, ...] = ()
    parameter_gradient: tuple[tuple[int, int], ...] = ()


def trace(
    module: nn.Module,
    layout: Layout,
    numbers: Numbers,
    sample: Mapping[str, Tensor],
    gradient: bool,
    outputs: int | None = None,
) -> Program:
    """Trace `module(y, *inputs)` at one state.

    Args:
        module: gives the derivative (n) of the state (n), or something else of another size.
        layout: sizes.
        numbers: its parameters and buffers.
        sample: state "y" and inputs by name: values do not matter but must be admissible.
        gradient: whether the vector-Jacobian product is wanted too.
        outputs: size of what the module gives; that of the state by default.

    Raises:
        CannotCompile: the module does something that is not covered.
    """
    outputs = layout.state if outputs is None else outputs
    scalars = Scalars()
    recorder = Recorder(scalars, apply)
    values, place, fixed = {}, 0, numbers.fixed()
    for name, tensor in zip(numbers.names, numbers.tensors, strict=True):
        leaf = tensor.detach().clone(memory_format=torch.contiguous_format)
        leaf.requires_grad_(gradient and name in numbers.wanted)
        flat = leaf.detach().reshape(-1).tolist()
        nodes = [
            scalars.constant(v) if fixed[place + k] else scalars.input("p", place + k)
            for k, v in enumerate(flat)
        ]
        values[name] = recorder.track(leaf, nodes)
        place += len(flat)

    def leaf_of(name: str, kind: str, begin: int) -> Tensor:
        one = sample[name].detach().clone().requires_grad_(gradient and name != layout.inputs[-1][0])
        return recorder.track(one, [scalars.input(kind, begin + k) for k in range(one.numel())])

    y, begin, inputs = leaf_of("y", "y", 0), 0, {}
    for name, size in layout.inputs:
        inputs[name] = leaf_of(name, "u", begin) if size != 0 else None
        begin += 1 if size is None else size
    back = torch.linspace(0.3, 0.7, outputs, dtype=torch.float64)
    recorder.track(back, [scalars.input("ct", k) for k in range(outputs)])
    wanted = [values[n] for n in numbers.wanted]
    followed = {n: x for n, x in inputs.items() if x is not None and x.requires_grad}

    def run() -> Program:
        rate = functional_call(module, values, (y, *inputs.values()))
        if not gradient:
            return Program(scalars, _nodes(recorder, rate))
        over = [y, *followed.values(), *wanted]
        slopes = (
            torch.autograd.grad(rate, over, back, allow_unused=True)
            if rate.requires_grad
            else [None] * len(over)
        )
        found = [
            (scalars.zero,) * x.numel() if g is None else _nodes(recorder, g)
            for x, g in zip(over, slopes, strict=True)
        ]
        by_input = dict(zip(followed, found[1 : 1 + len(followed)], strict=True))
        flat = []
        for name, size in layout.inputs:
            flat += by_input.get(name, (scalars.zero,) * (1 if size is None else size))
        begins, at = {}, 0
        for name, tensor in zip(numbers.names, numbers.tensors, strict=True):
            begins[name] = at
            at += tensor.numel()
        by_number = [
            (begins[name] + k, node)
            for name, nodes in zip(numbers.wanted, found[1 + len(followed) :], strict=True)
            for k, node in enumerate(nodes)
            if node != scalars.zero
        ]
        return Program(scalars, _nodes(recorder, rate), found[0], tuple(flat), tuple(by_number))

    program = recorded(recorder, run, gradient)
    wanted_nodes = (
        *program.rate,
        *program.state_gradient,
        *program.input_gradient,
        *(n for _, n in program.parameter_gradient),
    )
    size = len(scalars.needed(wanted_nodes))
    if size > LARGEST:
        raise CannotCompile(f"{size} scalar operations a step: more than {LARGEST}, too large to unroll")
    return program


def trace_plain(function: Callable[[Tensor], Tensor], size: int) -> tuple[Program, Program]:
    """Trace a function of the state alone, without and with its vector-Jacobian product."""
    found = []
    for gradient in (False, True):
        module = _Plain(function)
        layout = Layout(size, (("time", None),))
        sample = {
            "y": torch.linspace(0.5, 1.0, size, dtype=torch.float64),
            "time": torch.zeros((), dtype=torch.float64),
        }
        found.append(trace(module, layout, Numbers.of(module), sample, gradient))
    return found[0], found[1]


class _Plain(nn.Module):
    def __init__(self, function: Callable[[Tensor], Tensor]) -> None:
        super().__init__()
        self.function = function

    def forward(self, y: Tensor, time: Tensor) -> Tensor:
        return self.function(y)


def recorded(recorder: Recorder, run: Callable[[], Program], gradient: bool) -> Program:
    """Run under the recorder, and turn whatever goes wrong into one kind of refusal.

    Args:
        recorder: notes the operations.
        run: does what is to be recorded.
        gradient: whether autograd is on meanwhile.
    """
    try:
        with recorder, torch.set_grad_enabled(gradient):
            return run()
    except CannotCompile:
        raise
    except (
        Exception
    ) as error:  # What a user's code does under tracing cannot be known beforehand; plain torch is at hand.
        raise CannotCompile(
            f"tracing failed: {type(error).__name__}: {str(error).splitlines()[0][:200]}"
        ) from error


def _nodes(recorder: Recorder, tensor: Tensor) -> tuple[int, ...]:
    return tuple(recorder.scalars.number(n) for n in recorder.nodes(tensor.detach()).reshape(-1).tolist())


__all__ = ["CannotCompile", "Layout", "Numbers", "Program", "trace", "trace_plain"]
