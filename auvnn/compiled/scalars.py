"""What a traced function computes, as a graph of scalar operations: folded, and each computed once."""

from __future__ import annotations

import math
from collections.abc import Iterable

NUMBER_OPS = ("add", "sub", "mul", "div", "max", "min", "pow", "atan2", "where")
FUNCTIONS = {
    "sqrt": math.sqrt,
    "exp": math.exp,
    "expm1": math.expm1,
    "log": math.log,
    "log1p": math.log1p,
    "tanh": math.tanh,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "atan": math.atan,
    "asin": math.asin,
    "acos": math.acos,
    "sinh": math.sinh,
    "cosh": math.cosh,
    "erf": math.erf,
    "floor": math.floor,
    "ceil": math.ceil,
}
"""Functions of one number that the generated code knows."""

COMPARISONS = ("lt", "le", "eq", "ne")
LOGICAL = (*COMPARISONS, "and", "or", "not")


class Scalars:
    """A graph of scalar operations; a node is its number, its operands have smaller numbers.

    Equal operations are one node. Constants are folded, and x + 0, x 0, x 1 and their like vanish: constant tables
    and matrices, most of which is zeros, then cost only what they hold. (0 times infinity is 0 here: a state that
    overflows is not finite in other elements, and reported anyway.)

    Attributes:
        operation: per node: "constant", "input", "take", or what it does.
        operands: per node, nodes; for a constant its value, for an input (kind, index).
        group: nodes that one tensor operation made, which may be computed side by side.
    """

    def __init__(self) -> None:
        """Start with node 0, the number zero."""
        self.operation: list[str] = []
        self.operands: list[tuple] = []
        self.group: dict[int, int] = {}
        self._found: dict[tuple, int] = {}
        self.zero = self.constant(0.0)
        self.one = self.constant(1.0)
        self.groups = 0

    def _node(self, operation: str, *operands: object) -> int:
        key = (operation, *operands)
        found = self._found.get(key)
        if found is None:
            found = len(self.operation)
            self.operation.append(operation)
            self.operands.append(operands)
            self._found[key] = found
        return found

    def constant(self, value: float | bool) -> int:
        """Return the node of a number, or of true or false."""
        if isinstance(value, bool):
            return self._node("truth", value)
        # Written out, so that NaN is equal to itself and -0.0 is not taken for 0.0.
        return self._node("constant", float(value).hex())

    def input(self, kind: str, index: int) -> int:
        """Return the node of one element of an input."""
        return self._node("input", kind, index)

    def value(self, node: int) -> float | bool | None:
        """Return the value of a constant, or None."""
        if self.operation[node] == "constant":
            return float.fromhex(self.operands[node][0])
        if self.operation[node] == "truth":
            return self.operands[node][0]
        return None

    def is_constant(self, node: int) -> bool:
        """Return whether the node is a number, or true or false."""
        return self.operation[node] in ("constant", "truth")

    def is_logical(self, node: int) -> bool:
        """Return whether the node is true or false rather than a number."""
        return self.operation[node] in LOGICAL or self.operation[node] == "truth"

    def number(self, node: int) -> int:
        """Return the node as a number: true is one."""
        return self.where(node, self.one, self.zero) if self.is_logical(node) else node

    def add(self, a: int, b: int) -> int:
        """Return a + b."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.constant(x + y)
        if x == 0.0:
            return b
        if y == 0.0:
            return a
        if self.operation[b] == "neg":
            return self.sub(a, self.operands[b][0])
        if self.operation[a] == "neg":
            return self.sub(b, self.operands[a][0])
        return self._node("add", *sorted((a, b)))

    def sub(self, a: int, b: int) -> int:
        """Return a - b."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.constant(x - y)
        if y == 0.0:
            return a
        if x == 0.0:
            return self.neg(b)
        if self.operation[b] == "neg":
            return self.add(a, self.operands[b][0])
        return self._node("sub", a, b)

    def neg(self, a: int) -> int:
        """Return -a."""
        x = self.value(a)
        if x is not None:
            return self.constant(-x)
        if self.operation[a] == "neg":
            return self.operands[a][0]
        return self._node("neg", a)

    def mul(self, a: int, b: int) -> int:
        """Return a b."""
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.constant(x * y)
        for number, other in ((x, b), (y, a)):
            if number == 0.0:
                return self.zero
            if number == 1.0:
                return other
            if number == -1.0:
                return self.neg(other)
        negative = (self.operation[a] == "neg") + (self.operation[b] == "neg")
        if negative:
            a, b = (self.operands[n][0] if self.operation[n] == "neg" else n for n in (a, b))
            return self.mul(a, b) if negative == 2 else self.neg(self.mul(a, b))
        return self._node("mul", *sorted((a, b)))

    def div(self, a: int, b: int) -> int:
        """Return a / b."""
        x, y = self.value(a), self.value(b)
        if y == 1.0:
            return a
        if x is not None and y:
            return self.constant(x / y)
        if x == 0.0 and y is None:
            return self.zero
        return self._node("div", a, b)

    def unary(self, name: str, a: int) -> int:
        """Return one of FUNCTIONS of a number."""
        x = self.value(a)
        if x is not None and math.isfinite(x):
            try:
                return self.constant(float(FUNCTIONS[name](x)))
            except (ValueError, OverflowError):
                pass
        return self._node(name, a)

    def abs(self, a: int) -> int:
        """Return |a|."""
        x = self.value(a)
        if x is not None:
            return self.constant(abs(x))
        return self._node("abs", self.operands[a][0] if self.operation[a] == "neg" else a)

    def binary(self, name: str, a: int, b: int) -> int:
        """Return pow(a, b), atan2(a, b), max(a, b) or min(a, b).

        Args:
            name: "pow", "atan2", "max" or "min".
            a: number of the first operand's node.
            b: number of the second operand's node.
        """
        return self._node(name, a, b)

    def where(self, condition: int, a: int, b: int) -> int:
        """Return a where the condition holds, else b.

        Args:
            condition: number of the condition's node.
            a: number of the node that is taken where it holds.
            b: number of the node that is taken elsewhere.
        """
        known = self.value(condition)
        if known is not None:
            return a if known else b
        if a == b:
            return a
        if self.operation[condition] == "not":
            condition, a, b = self.operands[condition][0], b, a
        return self._node("where", condition, a, b)

    def compare(self, name: str, a: int, b: int) -> int:
        """Return whether a < b (lt), a <= b (le), a = b (eq) or not (ne).

        Args:
            name: "lt", "le", "eq" or "ne".
            a: number of the left operand's node.
            b: number of the right operand's node.
        """
        x, y = self.value(a), self.value(b)
        if x is not None and y is not None:
            return self.constant({"lt": x < y, "le": x <= y, "eq": x == y, "ne": x != y}[name])
        return self._node(name, a, b)

    def both(self, a: int, b: int) -> int:
        """Return whether a and b hold."""
        for known, other in ((self.value(a), b), (self.value(b), a)):
            if known is not None:
                return other if known else self.constant(False)
        return self._node("and", *sorted((a, b)))

    def either(self, a: int, b: int) -> int:
        """Return whether a or b holds."""
        for known, other in ((self.value(a), b), (self.value(b), a)):
            if known is not None:
                return self.constant(True) if known else other
        return self._node("or", *sorted((a, b)))

    def negated(self, a: int) -> int:
        """Return whether a does not hold."""
        known = self.value(a)
        if known is not None:
            return self.constant(not known)
        return self.operands[a][0] if self.operation[a] == "not" else self._node("not", a)

    def inverse(self, elements: Iterable[int], size: int) -> list[int]:
        """Return the elements of the inverse of a matrix, given and returned row by row."""
        whole = self._node("inverse", size, *elements)
        return [self._node("take", whole, k) for k in range(size * size)]

    def inputs_of(self, node: int) -> tuple[int, ...]:
        """Return the nodes that a node is computed from."""
        operation, operands = self.operation[node], self.operands[node]
        if operation in ("constant", "truth", "input"):
            return ()
        if operation == "take":
            return operands[:1]
        return operands[1:] if operation == "inverse" else operands

    def needed(self, wanted: Iterable[int]) -> list[int]:
        """Return the nodes that the wanted ones are computed from, these included, in an order of computation."""
        seen, stack = set(), list(wanted)
        while stack:
            node = stack.pop()
            if node not in seen:
                seen.add(node)
                stack.extend(self.inputs_of(node))
        return sorted(seen)
