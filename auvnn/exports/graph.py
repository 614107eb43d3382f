"""Functions as graphs of scalar operations: traced from torch, differentiated, and evaluated to check them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.compiled.program import Program, recorded
from auvnn.compiled.recorder import CannotCompile, Recorder
from auvnn.compiled.rules import apply as rule
from auvnn.compiled.scalars import FUNCTIONS, Scalars
from auvnn.errors import ConfigError
from auvnn.exports.slopes import partials

LARGEST = 200_000
"""Scalar operations beyond which nothing is written: such code cannot be compiled in minutes."""


@dataclass(frozen=True)
class Graph:
    """A function of named arguments.

    Attributes:
        scalars: the operations; the elements of an argument are inputs (name, index).
        arguments: name to size.
        results: nodes.
    """

    scalars: Scalars
    arguments: dict[str, int]
    results: tuple[int, ...]

    @property
    def operations(self) -> int:
        """Number of operations that it takes."""
        plain = ("constant", "truth", "input")
        return sum(self.scalars.operation[n] not in plain for n in self.scalars.needed(self.results))


def traced(function: Callable[..., Tensor], samples: Mapping[str, Tensor]) -> Graph:
    """Trace a torch function of double tensors without a batch, whose parameters are constants.

    Args:
        function: of the arguments in order; returns one vector.
        samples: an admissible value of each argument.

    Raises:
        ConfigError: it does something that cannot be written as straight-line code.
    """
    scalars = Scalars()
    recorder = Recorder(scalars, rule)
    leaves = []
    for name, value in samples.items():
        leaf = value.detach().clone(memory_format=torch.contiguous_format)
        leaves.append(recorder.track(leaf, [scalars.input(name, k) for k in range(leaf.numel())]))

    def run() -> Program:
        out = recorder.nodes(function(*leaves).detach()).reshape(-1).tolist()
        return Program(scalars, tuple(scalars.number(n) for n in out))

    try:
        with torch.inference_mode(False):
            program = recorded(recorder, run, gradient=False)
    except CannotCompile as no:
        raise ConfigError(f"the model cannot be written as straight-line code: {no}; use to=torch") from None
    return plain(Graph(scalars, {n: v.numel() for n, v in samples.items()}, program.rate))


def plain(graph: Graph) -> Graph:
    """Return a graph with inverses of matrices written out, and what is not needed left out.

    Gauss-Jordan elimination without exchange of rows: the one matrix that is inverted at run time is M_RB + M_A, which
    is symmetric and positive definite (Golub and Van Loan (2013), section 4.2).
    """
    old, new = graph.scalars, Scalars()
    found: dict[int, Any] = {}
    for node in old.needed(graph.results):
        name, operands = old.operation[node], old.operands[node]
        if name in ("constant", "truth"):
            value = old.value(node)
            assert value is not None
            found[node] = new.constant(value)
        elif name == "input":
            found[node] = new.input(*operands)
        elif name == "inverse":
            found[node] = _inverse(new, [found[n] for n in operands[1:]], operands[0])
        elif name == "take":
            found[node] = found[operands[0]][operands[1]]
        else:
            found[node] = apply(new, name, [found[n] for n in operands])
    made = Graph(new, graph.arguments, tuple(found[n] for n in graph.results))
    if made.operations > LARGEST:
        raise ConfigError(
            f"the model takes {made.operations} scalar operations, too many to write out; use to=torch"
        )
    return made


def apply(s: Scalars, name: str, operands: Sequence[int]) -> int:
    """Return the node of an operation by its name, folded.

    Args:
        s: in which the node is made.
        name: of the operation ("add", "lt", "sin", ...).
        operands: numbers of their nodes.
    """
    direct: dict[str, Callable[..., int]] = {
        "add": s.add, "sub": s.sub, "mul": s.mul, "div": s.div, "neg": s.neg, "abs": s.abs, "where": s.where,
        "and": s.both, "or": s.either, "not": s.negated,
    }  # fmt: skip
    if name in direct:
        return direct[name](*operands)
    if name in ("lt", "le", "eq", "ne"):
        return s.compare(name, *operands)
    if name in FUNCTIONS:
        return s.unary(name, operands[0])
    return s.binary(name, *operands)


def _inverse(s: Scalars, elements: list[int], n: int) -> list[int]:
    left = [elements[n * i : n * (i + 1)] for i in range(n)]
    right = [[s.one if i == j else s.zero for j in range(n)] for i in range(n)]
    for c in range(n):
        pivot = left[c][c]
        for rows in (left, right):
            rows[c] = [s.div(v, pivot) for v in rows[c]]
        for r in range(n):
            if r != c:
                factor = left[r][c]
                for rows in (left, right):
                    rows[r] = [s.sub(v, s.mul(factor, w)) for v, w in zip(rows[r], rows[c], strict=True)]
    return [v for row in right for v in row]


def differentiated(graph: Graph, arguments: tuple[str, ...]) -> Graph:
    """Return the graph of the Jacobians in some arguments, each row by row, one after the other."""
    s = graph.scalars
    slopes: dict[int, dict[int, int]] = {}
    for node in s.needed(graph.results):
        name = s.operation[node]
        if name == "input":
            slopes[node] = {node: s.one} if s.operands[node][0] in arguments else {}
            continue
        own: dict[int, int] = {}
        given = [n for n in s.inputs_of(node) if slopes.get(n)]
        if given and not s.is_logical(node):
            for operand, partial in partials(s, node):
                for source, slope in slopes.get(operand, {}).items():
                    own[source] = s.add(own.get(source, s.zero), s.mul(partial, slope))
        slopes[node] = own
    results = []
    for argument in arguments:
        inputs = [s.input(argument, k) for k in range(graph.arguments[argument])]
        for node in graph.results:
            results += [slopes[node].get(source, s.zero) for source in inputs]
    made = Graph(s, graph.arguments, tuple(results))
    if made.operations > LARGEST:
        raise ConfigError(f"the Jacobian takes {made.operations} scalar operations, too many to write out")
    return made


NUMPY: dict[str, Callable[..., Any]] = {
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "neg": np.negative, "abs": np.abs,
    "max": np.maximum, "min": np.minimum, "pow": np.power, "atan2": np.arctan2, "where": np.where, "lt": np.less,
    "le": np.less_equal, "eq": np.equal, "ne": np.not_equal, "and": np.logical_and, "or": np.logical_or,
    "not": np.logical_not, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
}  # fmt: skip


def evaluate(graph: Graph, arguments: Mapping[str, Any]) -> np.ndarray:
    """Return the results (N, k) at arguments (N, size) or (N)."""
    s = graph.scalars
    columns = {name: np.asarray(a, dtype=float) for name, a in arguments.items()}
    count = len(next(iter(columns.values())))
    values: dict[int, Any] = {}
    with np.errstate(all="ignore"):
        for node in s.needed(graph.results):
            name, operands = s.operation[node], s.operands[node]
            if s.is_constant(node):
                values[node] = s.value(node)
            elif name == "input":
                values[node] = columns[operands[0]].reshape(count, -1)[:, operands[1]]
            elif name == "erf":
                from scipy.special import erf

                values[node] = erf(values[operands[0]])
            else:
                function = NUMPY.get(name) or getattr(np, name)
                values[node] = function(*(values[n] for n in operands))
    if not graph.results:
        return np.zeros((count, 0))
    return np.stack([np.broadcast_to(values[n], (count,)) for n in graph.results], axis=-1)
