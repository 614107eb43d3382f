"""Compiled code as a function of tensors, with its gradient."""

from __future__ import annotations

import ctypes
from typing import Any

import torch
from torch import Tensor

from auvnn.compiled import toolchain
from auvnn.compiled.program import Layout
from auvnn.compiled.recorder import CannotCompile

LANES = 4
"""Trajectories side by side: a vector register of most processors; more make compilers slow and spill."""


class _Problem(ctypes.Structure):
    _fields_ = (
        *((n, ctypes.c_long) for n in ("batch", "rows", "parts")),
        *((n, ctypes.c_void_p) for n in ("y0", "mean", "slope")),
        *((n, ctypes.c_long) for n in ("drive_batch", "drive_row", "drive_part")),
        ("row", ctypes.c_void_p),
        ("row_batch", ctypes.c_long),
        ("time", ctypes.c_void_p),
        ("time_batch", ctypes.c_long),
        ("p", ctypes.c_void_p),
    )


class _Adjoint(ctypes.Structure):
    _fields_ = tuple((n, ctypes.c_void_p) for n in ("run", "back", "y0", "mean", "slope", "row", "p"))


def _at(tensor: Tensor | None) -> int | None:
    return None if tensor is None else tensor.data_ptr()


class Kernel:
    """An integrator that was generated and compiled for one right-hand side.

    Args:
        source: C.
        layout: what it is a function of.
        places: where in the row of numbers those are that it has a gradient in.
        gradient: whether it has one at all.
    """

    def __init__(self, source: str, layout: Layout, places: list[int], gradient: bool) -> None:
        """Compile nothing yet."""
        self.source = source
        self.layout = layout
        self.places = torch.tensor(places, dtype=torch.int64)
        self.gradient = gradient
        self.seconds = 0.0
        self._loaded: dict[int, ctypes.CDLL] = {}

    def is_ready(self, batch: int) -> bool:
        """Return whether nothing has to be compiled for so many trajectories."""
        lanes = self._lanes(batch)
        return lanes in self._loaded or toolchain.is_kept(self.source, lanes)

    @staticmethod
    def _lanes(batch: int) -> int:
        return LANES if batch > 1 else 1

    def load(self, batch: int) -> ctypes.CDLL:
        """Return the code for so many trajectories, compiled if need be.

        Raises:
            CannotCompile: see `toolchain.build`.
        """
        lanes = self._lanes(batch)
        if lanes not in self._loaded:
            self._loaded[lanes], spent = toolchain.build(self.source, lanes)
            self.seconds += spent
        return self._loaded[lanes]

    def rate(self, y: Tensor, u: Tensor, numbers: Tensor, batch: int | None = None) -> Tensor:
        """Return the derivative at states (N, n) and inputs (N, m), by the code for so many trajectories.

        Args:
            y: states (N, n).
            u: inputs (N, m).
            numbers: parameters and constants of the code, (K,).
            batch: for how many trajectories the code is compiled; N by default.
        """
        y, u, numbers = (x.detach().contiguous() for x in (y, u, numbers))
        out = torch.empty_like(y)
        self.load(batch or len(y)).auvnn_rate(
            ctypes.c_long(len(y)), *(ctypes.c_void_p(_at(x)) for x in (y, u, numbers, out))
        )
        return out

    def rate_back(
        self, y: Tensor, u: Tensor, numbers: Tensor, back: Tensor, batch: int | None = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return products of cotangents (N, n) with the Jacobians: in y (N, n), u (N, m), and summed in numbers.

        Args:
            y: states (N, n).
            u: inputs (N, m).
            numbers: parameters and constants of the code, (K,).
            back: cotangents of the derivative, (N, n).
            batch: for how many trajectories the code is compiled; N by default.
        """
        y, u, numbers, back = (x.detach().contiguous() for x in (y, u, numbers, back))
        gy, gu, found = torch.empty_like(y), torch.empty_like(u), numbers.new_zeros(len(self.places))
        given = (y, u, numbers, back, gy, gu, found)
        failed = self.load(batch or len(y)).auvnn_rate_back(
            ctypes.c_long(len(y)), *(ctypes.c_void_p(_at(x)) for x in given)
        )
        _require(failed)
        return gy, gu, torch.zeros_like(numbers).index_put_((self.places,), found)

    def run(
        self,
        y0: Tensor,
        mean: Tensor,
        slope: Tensor | None,
        row: Tensor,
        times: Tensor,
        numbers: Tensor,
        parts: int,
    ) -> Tensor:
        """Integrate; differentiable once in everything but the times.

        Args:
            y0: (B, n).
            mean: average of the first input over each step, (B or 1, T - 1 or more, parts or 1, m).
            slope: its rise over the step, of the same shape, or None.
            row: the other inputs but the time, held over each interval, (B or 1, T, k).
            times: (B or 1, T).
            numbers: the row of parameters and buffers.
            parts: equal steps per interval.

        Returns:
            (B, T, n).

        Raises:
            CannotCompile: the code was made for inputs of other sizes, and would read beyond them.
        """
        first, *held, _ = (1 if size is None else size for _, size in self.layout.inputs)
        if (mean.shape[-1], row.shape[-1]) != (first, sum(held)):
            raise CannotCompile(
                f"{mean.shape[-1]} and {row.shape[-1]} numbers as inputs of {self.layout.inputs}"
            )
        return _Run.apply(self, parts, y0, mean, slope, row, times, numbers)  # type: ignore[no-any-return]


def _require(failed: int) -> None:
    if failed:
        raise MemoryError("no memory for the adjoint of a free run")


def _problem(
    y0: Tensor, mean: Tensor, slope: Tensor | None, row: Tensor, times: Tensor, numbers: Tensor, parts: int
) -> _Problem:
    def stride(x: Tensor, dim: int) -> int:
        return 0 if x.shape[dim] == 1 else x.stride(dim)

    return _Problem(
        y0.shape[0], times.shape[-1], parts, _at(y0), _at(mean), _at(slope),
        stride(mean, 0), mean.stride(1), stride(mean, 2), _at(row), stride(row, 0),
        _at(times), stride(times, 0), _at(numbers),
    )  # fmt: skip


class _Run(torch.autograd.Function):
    """The compiled integrator and its discrete adjoint as one operation."""

    @staticmethod
    def forward(ctx: Any, kernel: Kernel, parts: int, *given: Tensor | None) -> Tensor:
        tensors = [None if x is None else x.detach().contiguous() for x in given]
        y0 = tensors[0]
        assert y0 is not None
        out = y0.new_empty(y0.shape[0], tensors[4].shape[-1], y0.shape[-1])  # type: ignore[union-attr]
        problem = _problem(*tensors, parts)  # type: ignore[arg-type]
        kernel.load(len(y0)).auvnn_run(ctypes.byref(problem), ctypes.c_void_p(out.data_ptr()))
        ctx.kernel, ctx.parts = kernel, parts
        ctx.save_for_backward(out, *tensors)
        return out

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple:  # pyright: ignore[reportIncompatibleMethodOverride]
        out, *tensors = ctx.saved_tensors
        y0, numbers = tensors[0], tensors[5]
        kernel: Kernel = ctx.kernel
        back = grads[0].contiguous()
        needed = ctx.needs_input_grad[2:]
        found = [
            torch.zeros_like(x) if x is not None and n else None for x, n in zip(tensors, needed, strict=True)
        ]
        gy0, by_number = torch.zeros_like(y0), numbers.new_zeros(len(kernel.places))
        problem = _problem(*tensors, ctx.parts)  # type: ignore[call-arg]
        adjoint = _Adjoint(
            _at(out), _at(back), _at(gy0), _at(found[1]), _at(found[2]), _at(found[3]), _at(by_number)
        )
        _require(kernel.load(len(y0)).auvnn_back(ctypes.byref(problem), ctypes.byref(adjoint)))
        found[0] = gy0
        if needed[5]:
            found[5] = torch.zeros_like(numbers).index_put_((kernel.places,), by_number)
        return None, None, *found[:4], None, found[5]


__all__ = ["LANES", "CannotCompile", "Kernel"]
