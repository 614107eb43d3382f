"""Rules of torch operations that act element by element."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from auvnn.compiled.recorder import CannotCompile, Recorder
from auvnn.compiled.scalars import Scalars

aten = torch.ops.aten


Rule = Callable[..., Tensor]


def _each(r: Recorder, make: Callable[..., int], *operands: Any) -> Tensor:
    """Apply a scalar operation to every element of operands that broadcast; plain numbers are constants."""
    s = r.scalars
    arrays = [
        r.nodes(x) if isinstance(x, Tensor) else torch.tensor(s.constant(x), dtype=torch.int64)
        for x in operands
    ]
    arrays = torch.broadcast_tensors(*arrays)
    flat = [make(*nodes) for nodes in zip(*(a.reshape(-1).tolist() for a in arrays), strict=True)]
    return torch.tensor(flat, dtype=torch.int64).reshape(arrays[0].shape)


def _numeric(s: Scalars, make: Callable[..., int]) -> Callable[..., int]:
    return lambda *nodes: make(*(s.number(n) for n in nodes))


def _elementwise(build: Callable[[Scalars], Callable[..., int]], count: int) -> Rule:
    def rule(r: Recorder, *operands: Any) -> Tensor:
        return _each(r, _numeric(r.scalars, build(r.scalars)), *operands[:count])

    return rule


def _function(name: str) -> Rule:
    def rule(r: Recorder, x: Tensor) -> Tensor:
        s = r.scalars
        before = len(s.operation)
        out = _each(r, _numeric(s, lambda a: s.unary(name, a)), x)
        s.groups += 1
        for node in out.reshape(-1).tolist():
            # Those that an earlier operation made belong there: their place in the order is earlier.
            if node >= before and s.operation[node] == name:
                s.group[node] = s.groups
        return out

    return rule


def _add(r: Recorder, a: Any, b: Any, *, alpha: float = 1) -> Tensor:
    s = r.scalars
    return _each(r, _numeric(s, lambda x, y: s.add(x, s.mul(s.constant(float(alpha)), y))), a, b)


def _sub(r: Recorder, a: Any, b: Any, alpha: float = 1) -> Tensor:
    return _add(r, a, b, alpha=-alpha)


def _rsub(r: Recorder, a: Any, b: Any, alpha: float = 1) -> Tensor:
    s = r.scalars
    return _each(r, _numeric(s, lambda x, y: s.sub(y, s.mul(s.constant(float(alpha)), x))), a, b)


def _div(r: Recorder, a: Any, b: Any, rounding_mode: str | None = None) -> Tensor:
    s = r.scalars
    if rounding_mode not in (None, "floor"):
        raise CannotCompile(f"division rounded by {rounding_mode!r}")
    out = _numeric(s, s.div)
    return _each(r, out if rounding_mode is None else lambda x, y: s.unary("floor", out(x, y)), a, b)


def _remainder(r: Recorder, a: Any, b: Any) -> Tensor:
    s = r.scalars
    return _each(r, _numeric(s, lambda x, y: s.sub(x, s.mul(y, s.unary("floor", s.div(x, y))))), a, b)


def _power(s: Scalars, base: int, exponent: int) -> int:
    p = s.value(exponent)
    if p is not None and p == int(p) and 0 <= p <= 8:
        out = s.one
        for _ in range(int(p)):
            out = s.mul(out, base)
        return out
    if p == 0.5:
        return s.unary("sqrt", base)
    if p == -1.0:
        return s.div(s.one, base)
    return s.binary("pow", base, exponent)


def _largest(s: Scalars, a: int, b: int, name: str) -> int:
    return a if a == b else s.binary(name, a, b)


def _clamp(r: Recorder, x: Tensor, min: Any = None, max: Any = None) -> Tensor:
    s = r.scalars
    out = r.nodes(x)
    for bound, name in ((min, "max"), (max, "min")):
        if bound is not None:
            limit = r.nodes(bound) if isinstance(bound, Tensor) else torch.tensor(s.constant(float(bound)))
            pairs = torch.broadcast_tensors(out, limit)
            flat = [
                _largest(s, s.number(a), b, name)
                for a, b in zip(*(p.reshape(-1).tolist() for p in pairs), strict=True)
            ]
            out = torch.tensor(flat, dtype=torch.int64).reshape(pairs[0].shape)
    return out


def _sign(s: Scalars, a: int) -> int:
    negative = s.where(s.compare("lt", a, s.zero), s.constant(-1.0), s.zero)
    return s.where(s.compare("lt", s.zero, a), s.one, negative)


def _sigmoid(s: Scalars, a: int) -> int:
    return s.div(s.one, s.add(s.one, s.unary("exp", s.neg(a))))


def _softplus(r: Recorder, x: Tensor, beta: float = 1, threshold: float = 20) -> Tensor:
    s = r.scalars

    def one(a: int) -> int:
        scaled = s.mul(a, s.constant(float(beta)))
        soft = s.div(s.unary("log1p", s.unary("exp", scaled)), s.constant(float(beta)))
        return s.where(s.compare("lt", s.constant(float(threshold)), scaled), a, soft)

    return _each(r, one, x)


def _softplus_backward(r: Recorder, g: Tensor, x: Tensor, beta: float, threshold: float) -> Tensor:
    s = r.scalars

    def one(up: int, a: int) -> int:
        scaled = s.mul(a, s.constant(float(beta)))
        return s.where(
            s.compare("lt", s.constant(float(threshold)), scaled), up, s.mul(up, _sigmoid(s, scaled))
        )

    return _each(r, one, g, x)


def _where(r: Recorder, condition: Tensor, a: Any, b: Any) -> Tensor:
    s = r.scalars
    return _each(r, lambda c, x, y: s.where(c, s.number(x), s.number(y)), condition, a, b)


def _masked_fill(r: Recorder, x: Tensor, mask: Tensor, value: Any) -> Tensor:
    s = r.scalars
    value = float(value) if not isinstance(value, Tensor) else value
    return _each(r, lambda n, m, v: s.where(m, v, n), x, mask, value)


def _comparison(name: str, swapped: bool = False) -> Rule:
    def rule(r: Recorder, a: Any, b: Any) -> Tensor:
        s = r.scalars
        return _each(r, _numeric(s, lambda x, y: s.compare(name, *((y, x) if swapped else (x, y)))), a, b)

    return rule


def _logical(make: Callable[[Scalars], Callable[..., int]]) -> Rule:
    def rule(r: Recorder, *operands: Any) -> Tensor:
        s = r.scalars
        truth = lambda n: n if s.is_logical(n) else s.compare("ne", n, s.zero)  # noqa: E731
        return _each(r, lambda *nodes: make(s)(*(truth(n) for n in nodes)), *operands)

    return rule
