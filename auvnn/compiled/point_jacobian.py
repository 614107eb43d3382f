"""Jacobians of a function at many points, as machine code."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files

import torch
from torch import Tensor

from auvnn.compiled import toolchain
from auvnn.compiled.program import Layout, Program
from auvnn.compiled.source import REAL_HELP, constant_part, function_of, table
from auvnn.compiled.writer import Writer

LANES = 8
"""Rows of Jacobians side by side: of the six of an acceleration more than one vector register of most processors."""


class PointJacobian:
    """The Jacobians of a traced function in its state, in its first input, and in parameters.

    Reverse mode, once for each row: a function of few results has few rows, and however many parameters.

    Args:
        program: the function with its vector-Jacobian product.
        layout: what it is a function of.
    """

    def __init__(self, program: Program, layout: Layout) -> None:
        """Write the code, and compile nothing yet."""
        self.rows = len(program.rate)
        self.first = layout.inputs[0][1] or 1
        self.state = layout.state
        self.places = [place for place, _ in program.parameter_gradient]
        self.source = _write(program, layout, self.first)
        self._loaded: ctypes.CDLL | None = None

    def load(self) -> ctypes.CDLL:
        """Return the code, compiled if need be.

        Raises:
            CannotCompile: see `toolchain.build`.
        """
        if self._loaded is None:
            self._loaded, _ = toolchain.build(self.source, LANES)
        return self._loaded

    def at(
        self,
        y: Tensor,
        u: Tensor,
        numbers: Tensor,
        columns: Sequence[int | None],
        width: int,
        threads: int = 1,
    ) -> Tensor:
        """Return the Jacobians (N, rows, width).

        Args:
            y: states (N, n).
            u: inputs side by side, (N, m).
            numbers: parameters and constants of the code, (K,).
            columns: of each number its column, beyond those of state and first input; None where it has none.
            width: number of all columns.
            threads: that share the points.
        """
        y, u, numbers = (x.detach().contiguous() for x in (y, u, numbers))
        # What has no column goes into one that is cut off.
        lead = self.state + self.first
        asked = [columns[place] for place in self.places]
        to = torch.tensor(
            [*range(lead), *(width if c is None else lead + c for c in asked)], dtype=torch.int64
        )
        spare = int(None in asked)
        out = y.new_zeros(len(y), self.rows, width + spare)
        code, count = self.load().auvnn_jacobian, len(y) * self.rows
        given = [ctypes.c_void_p(x.data_ptr()) for x in (y, u, numbers, to)]

        def run(begin: int, end: int) -> None:
            code(
                ctypes.c_long(begin),
                ctypes.c_long(end),
                *given,
                ctypes.c_long(out.shape[-1]),
                ctypes.c_void_p(out.data_ptr()),
            )

        edges = [count * k // threads for k in range(threads + 1)]
        if threads == 1:
            run(0, count)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(run, edges[:-1], edges[1:]))
        return out[..., :width] if spare else out


def _write(program: Program, layout: Layout, first: int) -> str:
    s = program.scalars
    wanted = [
        *program.state_gradient,
        *program.input_gradient[:first],
        *(node for _, node in program.parameter_gradient),
    ]
    _, edge = constant_part(s, wanted)
    hoist, body = Writer(s, {}, real=True), Writer(s, {node: k for k, node in enumerate(edge)})
    head = "static __attribute__((noinline)) void back(const V *restrict y, const V *restrict u, "
    head += "const double *restrict p, const double *restrict b, const V *restrict ct, V *restrict out)"
    here = files("auvnn.compiled")
    prelude, driver = (
        here.joinpath(n).read_text(encoding="utf-8") for n in ("prelude.h", "point_jacobian.c")
    )
    return "\n".join([
        prelude,
        table("NY", layout.state, "NU", layout.width, "ROWS", len(program.rate), "NB", len(edge), "NG", len(wanted)),
        REAL_HELP,
        function_of(
            "static void prologue(const double *p, double *b)", [*hoist.body(edge), *hoist.store("b", edge)]
        ),
        function_of(head, [*body.body(wanted), *body.store("out", wanted)]),
        driver,
    ])  # fmt: skip
