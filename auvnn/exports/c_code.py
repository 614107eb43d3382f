"""Graphs of scalar operations as C99: straight-line functions without memory of their own."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from auvnn.compiled.scalars import FUNCTIONS
from auvnn.exports.graph import Graph

INFIX = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!=", "and": "&&", "or": "||",
}  # fmt: skip
WIDTH = 118


@dataclass(frozen=True)
class Dialect:
    """How numbers and functions are written.

    Attributes:
        prefix: of the helpers `largest` and `smallest`.
        single: single precision.
    """

    prefix: str
    single: bool

    @property
    def type(self) -> str:
        """The type of a number."""
        return "float" if self.single else "double"

    def function(self, name: str) -> str:
        """Return the name of a function of math.h."""
        return {"abs": "fabs"}.get(name, name) + ("f" if self.single else "")

    def number(self, value: float) -> str:
        """Return a number, exactly or to the nearest that single precision has."""
        if math.isnan(value):
            return "NAN"
        if math.isinf(value):
            return "INFINITY" if value > 0 else "(-INFINITY)"
        if self.single:
            text = str(np.float32(value))
            text = f"{text if any(c in text for c in '.en') else text + '.0'}f"
        else:
            text = repr(float(value))
        return f"({text})" if text.startswith("-") else text

    def statements(self, graph: Graph, targets: Mapping[str, Sequence[int]]) -> list[str]:
        """Return the statements that compute a graph's nodes and leave them in arrays.

        Args:
            graph: the graph; its arguments are arrays of their names, those of size 0 dimensions plain numbers.
            targets: array to the nodes that go into it.
        """
        s = graph.scalars
        wanted = [n for nodes in targets.values() for n in nodes]
        lines = []
        for node in s.needed(wanted):
            name, operands = s.operation[node], s.operands[node]
            if name in ("constant", "truth", "input"):
                continue
            given = [self._name(graph, n) for n in operands]
            if name in INFIX:
                text = f"{given[0]} {INFIX[name]} {given[1]}"
            elif name == "neg":
                text = f"-{given[0]}"
            elif name == "not":
                text = f"!{given[0]}"
            elif name == "where":
                text = f"{given[0]} ? {given[1]} : {given[2]}"
            elif name in ("max", "min"):
                text = f"{self.prefix}_{'largest' if name == 'max' else 'smallest'}({given[0]}, {given[1]})"
            elif name in (*FUNCTIONS, "abs", "pow", "atan2"):
                text = f"{self.function(name)}({', '.join(given)})"
            else:
                raise ValueError(f"no C for {name}")
            kind = "int" if s.is_logical(node) else self.type
            lines.append(f"const {kind} t{node} = {text};")
        for array, nodes in targets.items():
            lines += [f"{array}[{k}] = {self._name(graph, n)};" for k, n in enumerate(nodes)]
        return lines

    def _name(self, graph: Graph, node: int) -> str:
        s = graph.scalars
        value = s.value(node)
        if isinstance(value, bool):
            return "1" if value else "0"
        if value is not None:
            return self.number(value)
        if s.operation[node] == "input":
            name, index = s.operands[node]
            return name if name in ("t", "h") else f"{name}[{index}]"
        return f"t{node}"

    def helpers(self) -> str:
        """Return what the statements call."""
        t = self.type
        return (
            f"static inline {t} {self.prefix}_largest({t} a, {t} b) {{ return a > b || a != a ? a : b; }}\n"
            f"static inline {t} {self.prefix}_smallest({t} a, {t} b) {{ return a < b || a != a ? a : b; }}\n"
        )

    def function_of(
        self, head: str, graph: Graph, targets: Mapping[str, Sequence[int]], also: Sequence[str] = ()
    ) -> str:
        """Return a whole function; arguments (and those in `also`) that may be without use are named all the same."""
        unused = [f"(void){name};" for name in (*graph.arguments, *also)]
        return block(head, [*unused, *self.statements(graph, targets)])

    def array(self, name: str, values: Iterable[float], qualifier: str = "static const") -> str:
        """Return an array of numbers."""
        texts = [self.number(float(v)) for v in values]
        lines, line = [], "   "
        for text in texts:
            if len(line) + len(text) + 2 > WIDTH:
                lines.append(line)
                line = "   "
            line += f" {text},"
        return (
            f"{qualifier} {self.type} {name}[{max(len(texts), 1)}] = {{\n"
            + "\n".join([*lines, line])
            + "\n};\n"
        )


def block(head: str, lines: Iterable[str]) -> str:
    """Return a function from its head and its statements."""
    return "\n".join([head, "{", *("    " + line for line in lines), "}", ""])
