"""Graphs of scalar operations as C99: straight-line functions without memory."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from auvnn.compiled.scalars import FUNCTIONS
from auvnn.exports.graph import Graph

INFIX = {
    "add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!=",
    "and": "&&", "or": "||",
}  # fmt: skip
WIDTH = 118
INLINE = ("sqrt", "floor", "ceil")
"""Functions that are an instruction on most processors."""
MANY = 4
"""Calls of one function that are made together: between two of them compilers can keep nothing in registers."""

TANH = (
    """\
/* tanh(x) = e / (e + 2), e = exp(2 |x|) - 1 = 2^k (1 + p) - 1, p the series of exp(r) - 1: to a few last digits. */
static double PREFIX_tanh(double x)
{
    static const double two[65] = {POWERS};
    const double z = 2.0 * fabs(x);
    if (!(z <= 44.0)) return x != x ? x : copysign(1.0, x);
    const int k = (int)(z * 1.4426950408889634 + 0.5);
    const double r = (z - k * 0x1.62e42fefa0000p-1) - k * 0x1.cf79abc9e3b3ap-40;
    const double r2 = r * r, r4 = r2 * r2, r8 = r4 * r4;
    const double a0 = 1.0 + r * (1.0 / 2), a1 = 1.0 / 6 + r * (1.0 / 24), a2 = 1.0 / 120 + r * (1.0 / 720);
    const double a3 = 1.0 / 5040 + r * (1.0 / 40320), a4 = 1.0 / 362880 + r * (1.0 / 3628800);
    const double a5 = 1.0 / 39916800 + r * (1.0 / 479001600), a6 = 1.0 / 6227020800.0 + r * (1.0 / 87178291200.0);
    const double p = r * ((a0 + r2 * a1) + r4 * (a2 + r2 * a3) + r8 * ((a4 + r2 * a5) + r4 * a6));
    const double e = two[k] * p + (two[k] - 1.0);
    return copysign(e / (e + 2.0), x);
}
"""
).replace(
    "POWERS",
    "\n        "
    + ",\n        ".join(", ".join(repr(2.0**k) for k in range(n, min(n + 6, 65))) for n in range(0, 65, 6)),
)
"""As the compiled engine computes it, which calls no library: networks are little else than this function."""


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
        lines, done = [], set()
        order, groups = grouped(graph, wanted)
        for node in order:
            name, operands = s.operation[node], s.operands[node]
            if name in ("constant", "truth", "input") or node in done:
                continue
            if node in groups:
                members = groups[node]
                lines.append(f"{self.type} i{node}[{len(members)}], o{node}[{len(members)}];")
                lines += [
                    f"i{node}[{k}] = {self._name(graph, s.operands[m][0])};" for k, m in enumerate(members)
                ]
                lines.append(f"{self.prefix}_many_{name}(i{node}, o{node}, {len(members)});")
                lines += [f"const {self.type} t{m} = o{node}[{k}];" for k, m in enumerate(members)]
                done.update(members)
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

    def helpers(self, functions: set[str]) -> str:
        """Return what the statements call; `functions` are those that are called on many numbers at once."""
        t = self.type
        quick = "tanh" in functions and t == "double"
        own = {"tanh": f"{self.prefix}_tanh"} if quick else {}
        many = [
            f"static void {self.prefix}_many_{name}(const {t} *in, {t} *out, int count)\n"
            f"{{\n    for (int i = 0; i < count; i++) out[i] = {own.get(name, self.function(name))}(in[i]);\n}}\n"
            for name in sorted(functions)
        ]
        return (
            (TANH.replace("PREFIX", self.prefix) if quick else "")
            + "".join(many)
            + (
                f"static inline {t} {self.prefix}_largest({t} a, {t} b) {{ return a > b || a != a ? a : b; }}\n"
                f"static inline {t} {self.prefix}_smallest({t} a, {t} b) {{ return a < b || a != a ? a : b; }}\n"
            )
        )

    def function_of(
        self, head: str, graph: Graph, targets: Mapping[str, Sequence[int]], also: Sequence[str] = ()
    ) -> str:
        """Return a whole function; arguments (and those in `also`) that may be without use are named anyway.

        Args:
            head: of the function in the target's language.
            graph: of scalar operations.
            targets: nodes that are written, by the name of their array.
            also: further arguments that may be without use.
        """
        unused = [f"(void){name};" for name in (*graph.arguments, *also)]
        return block(head, [*unused, *self.statements(graph, targets)])

    def array(self, name: str, values: Iterable[float], qualifier: str = "static const") -> str:
        """Return an array of numbers.

        Args:
            name: of the array.
            values: in their order.
            qualifier: before the type.
        """
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


def grouped(graph: Graph, wanted: Iterable[int]) -> tuple[list[int], dict[int, list[int]]]:
    """Return the needed nodes in an order of computation, and by its first member each group of equal functions.

    Functions that depend on equally many functions before them do not depend on one another.
    """
    s, depth = graph.scalars, {}
    nodes = s.needed(wanted)
    called = {n for n in nodes if s.operation[n] in FUNCTIONS and s.operation[n] not in INLINE}
    for node in nodes:
        depth[node] = max((depth[n] + (n in called) for n in s.inputs_of(node)), default=0)
    order = sorted(nodes, key=lambda n: (depth[n], n in called, s.operation[n] if n in called else "", n))
    found: dict[tuple[int, str], list[int]] = {}
    for node in order:
        if node in called:
            found.setdefault((depth[node], s.operation[node]), []).append(node)
    return order, {members[0]: members for members in found.values() if len(members) >= MANY}
