"""The derivative of each scalar operation in each of its operands."""

from __future__ import annotations

import math
from collections.abc import Callable

from auvnn.compiled.scalars import Scalars

Rule = Callable[[Scalars, int, int], int]
"""From the graph, the operand and the operation's own node to the derivative's node."""


def _one_over(s: Scalars, a: int) -> int:
    return s.div(s.one, a)


def _square(s: Scalars, a: int) -> int:
    return s.mul(a, a)


def _root_of_one_less_square(s: Scalars, a: int) -> int:
    return s.unary("sqrt", s.sub(s.one, _square(s, a)))


SLOPES: dict[str, Rule] = {
    "sqrt": lambda s, a, y: s.div(s.constant(0.5), y),
    "exp": lambda s, a, y: y,
    "expm1": lambda s, a, y: s.add(y, s.one),
    "log": lambda s, a, y: _one_over(s, a),
    "log1p": lambda s, a, y: _one_over(s, s.add(s.one, a)),
    "tanh": lambda s, a, y: s.sub(s.one, _square(s, y)),
    "sin": lambda s, a, y: s.unary("cos", a),
    "cos": lambda s, a, y: s.neg(s.unary("sin", a)),
    "tan": lambda s, a, y: s.add(s.one, _square(s, y)),
    "atan": lambda s, a, y: _one_over(s, s.add(s.one, _square(s, a))),
    "asin": lambda s, a, y: _one_over(s, _root_of_one_less_square(s, a)),
    "acos": lambda s, a, y: s.neg(_one_over(s, _root_of_one_less_square(s, a))),
    "sinh": lambda s, a, y: s.unary("cosh", a),
    "cosh": lambda s, a, y: s.unary("sinh", a),
    "erf": lambda s, a, y: s.mul(s.constant(2.0 / math.sqrt(math.pi)), s.unary("exp", s.neg(_square(s, a)))),
    "floor": lambda s, a, y: s.zero,
    "ceil": lambda s, a, y: s.zero,
    "neg": lambda s, a, y: s.constant(-1.0),
    "abs": lambda s, a, y: s.where(
        s.compare("lt", s.zero, a), s.one, s.where(s.compare("lt", a, s.zero), s.constant(-1.0), s.zero)
    ),
}
"""Of the operations of one number."""


def partials(s: Scalars, node: int) -> list[tuple[int, int]]:
    """Return (operand, node of the derivative in it) of a node; at a kink the slope of one side."""
    name, operands = s.operation[node], s.operands[node]
    if name in SLOPES:
        return [(operands[0], SLOPES[name](s, operands[0], node))]
    if name == "where":
        condition, a, b = operands
        return [(a, s.where(condition, s.one, s.zero)), (b, s.where(condition, s.zero, s.one))]
    a, b = operands
    if name == "add":
        return [(a, s.one), (b, s.one)]
    if name == "sub":
        return [(a, s.one), (b, s.constant(-1.0))]
    if name == "mul":
        return [(a, b), (b, a)]
    if name == "div":
        return [(a, _one_over(s, b)), (b, s.neg(s.div(node, b)))]
    if name in ("max", "min"):
        first = s.compare("lt", b, a) if name == "max" else s.compare("lt", a, b)
        return [(a, s.where(first, s.one, s.zero)), (b, s.where(first, s.zero, s.one))]
    if name == "atan2":
        size = s.add(_square(s, a), _square(s, b))
        return [(a, s.div(b, size)), (b, s.neg(s.div(a, size)))]
    if name == "pow":
        by_base = s.mul(b, s.binary("pow", a, s.sub(b, s.one)))
        return [(a, by_base), (b, s.mul(node, s.unary("log", a)))]
    raise ValueError(f"no derivative of {name}")
