"""Expressions of a trace written as statements of C."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from auvnn.compiled.scalars import FUNCTIONS, Scalars

INLINE = ("sqrt", "floor", "ceil")


"""Functions that are an instruction; all others run over arrays, several numbers at once."""


INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "lt": "<", "le": "<=", "eq": "==", "ne": "!="}


CALLS = {"max": "v_max", "min": "v_min", "pow": "v_pow", "atan2": "v_atan2", "and": "AND", "or": "OR"}


def number(value: float) -> str:
    """Return a number in C, exactly."""
    if math.isnan(value):
        return "NAN"
    if math.isinf(value):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    return f"({value.hex()})" if value < 0 else value.hex()


@dataclass(frozen=True)
class Writer:
    """Writes straight-line functions over one graph.

    Args:
        scalars: the graph.
        hoisted: nodes that the prologue has worked out already, and their places in `b`.
        real: whether numbers are plain doubles (the prologue) rather than vectors of lanes.
    """

    scalars: Scalars
    hoisted: dict[int, int]
    real: bool = False

    def _name(self, node: int, vector: bool = False) -> str:
        s = self.scalars
        if s.operation[node] == "truth":
            return "TRUE" if s.value(node) else "FALSE"
        value = s.value(node)
        if value is not None:
            text = number(float(value))
        elif node in self.hoisted:
            text = f"b[{self.hoisted[node]}]"
        elif s.operation[node] == "input":
            kind, index = s.operands[node]
            text = f"{kind}[{index}]"
            vector = vector and kind == "p"
        else:
            return f"t{node}"
        # One number for all lanes must be spread where the other operand does not do so.
        return f"SPREAD({text})" if vector and not self.real else text

    def _shared(self, node: int) -> bool:
        """Return whether a node is one number for all lanes."""
        s = self.scalars
        return (
            s.is_constant(node)
            or node in self.hoisted
            or (s.operation[node] == "input" and s.operands[node][0] == "p")
        )

    def body(self, wanted: Iterable[int]) -> list[str]:
        """Return the statements that compute the wanted nodes."""
        s, lines, done = self.scalars, [], set()
        stop = self.hoisted
        seen, stack = set(), [n for n in wanted if n not in stop]
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(n for n in s.inputs_of(node) if n not in stop)
        order = sorted(seen)
        groups: dict[int, list[int]] = {}
        for node in order:
            if s.operation[node] in FUNCTIONS and s.operation[node] not in INLINE:
                groups.setdefault(s.group.get(node) or -node, []).append(node)
        kind = "double" if self.real else "V"
        lanes = "1" if self.real else "LANES"
        for node in order:
            operation, operands = s.operation[node], s.operands[node]
            if node in done or operation in ("constant", "truth", "input"):
                continue
            if operation in FUNCTIONS and operation not in INLINE:
                members = groups[s.group.get(node) or -node]
                # Room to whole vectors, whatever their width: what is beyond is computed for nothing.
                size = -(-len(members) // 8) * 8
                lines.append(
                    f"{kind} i{node}[{size}] __attribute__((aligned(64))), "
                    f"o{node}[{size}] __attribute__((aligned(64)));"
                )
                lines += [
                    f"i{node}[{k}] = {self._name(s.operands[m][0], True)};" for k, m in enumerate(members)
                ]
                lines += [f"i{node}[{k}] = i{node}[0];" for k in range(len(members), size)]
                lines.append(
                    f"many_{operation}((const double *)i{node}, (double *)o{node}, {len(members)} * {lanes});"
                )
                lines += [f"const {kind} t{m} = o{node}[{k}];" for k, m in enumerate(members)]
                done.update(members)
                continue
            if operation == "inverse":
                lines += self._inverse(node, operands)
                continue
            if operation == "take":
                lines.append(f"const {kind} t{node} = m{operands[0]}[{operands[1]}];")
                continue
            lines.append(self._statement(node, operation, operands))
        return lines

    def _statement(self, node: int, operation: str, operands: tuple) -> str:
        s = self.scalars
        vector = all(self._shared(n) for n in operands)
        kind = "double" if self.real else "V"
        if s.is_logical(node):
            kind = "int" if self.real else "B"
        if operation in INFIX:
            first = self._name(operands[0], vector or operation in ("lt", "le", "eq", "ne"))
            text = (
                f"{first} {INFIX[operation]} {self._name(operands[1], operation in ('lt', 'le', 'eq', 'ne'))}"
            )
        elif operation == "neg":
            text = f"-{self._name(operands[0], True)}"
        elif operation == "abs":
            text = f"v_abs({self._name(operands[0], True)})"
        elif operation == "not":
            text = f"NOT({self._name(operands[0])})"
        elif operation == "where":
            c, a, b = operands
            text = f"pick({self._name(c)}, {self._name(a, True)}, {self._name(b, True)})"
        elif operation in INLINE:
            text = f"v_{operation}({self._name(operands[0], True)})"
        else:
            text = f"{CALLS[operation]}({', '.join(self._name(n, True) for n in operands)})"
        if self.real:
            for vectorial, plain in REAL.items():
                text = text.replace(vectorial, plain)
        return f"const {kind} t{node} = {text};"

    def _inverse(self, node: int, operands: tuple) -> list[str]:
        size, elements = operands[0], operands[1:]
        if self.real:
            fill = [f"a{node}[{k}] = {self._name(n)};" for k, n in enumerate(elements)]
            count = size * size
            return [
                f"double a{node}[{count}], m{node}[{count}];",
                *fill,
                f"invert(a{node}, m{node}, {size});",
            ]
        count = size * size
        return [
            f"V a{node}[{count}], m{node}[{count}];",
            *(f"a{node}[{k}] = {self._name(n, True)};" for k, n in enumerate(elements)),
            "for (int l = 0; l < LANES; l++) {",
            f"double one[{count}], other[{count}];",
            f"for (int i = 0; i < {count}; i++) one[i] = LANE(a{node}[i], l);",
            f"invert(one, other, {size});",
            f"for (int i = 0; i < {count}; i++) LANE(m{node}[i], l) = other[i];",
            "}",
        ]

    def store(self, place: str, nodes: Sequence[int], sign: str = "=") -> list[str]:
        """Return the statements that leave nodes in an array."""
        return [f"{place}[{k}] {sign} {self._name(n, True)};" for k, n in enumerate(nodes)]


REAL = {"v_abs(": "fabs(", "v_sqrt(": "sqrt(", "v_floor(": "floor(", "v_ceil(": "ceil(", "v_pow(": "pow(",
        "v_atan2(": "atan2(", "v_max(": "r_max(", "v_min(": "r_min(", "pick(": "r_pick(", "AND(": "R_AND(",
        "NOT(": "R_NOT(", "OR(": "R_OR(", "TRUE": "1", "FALSE": "0"}  # fmt: skip
