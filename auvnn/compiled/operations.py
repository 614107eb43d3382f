"""What torch's basic operations are, written as scalar operations: the table of what the compiler knows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from auvnn.compiled.elementwise import (
    Rule,
    _add,
    _clamp,
    _comparison,
    _div,
    _each,
    _elementwise,
    _function,
    _largest,
    _logical,
    _masked_fill,
    _power,
    _remainder,
    _rsub,
    _sigmoid,
    _sign,
    _softplus,
    _softplus_backward,
    _sub,
    _where,
    aten,
)
from auvnn.compiled.recorder import CannotCompile, Recorder, tensors
from auvnn.compiled.scalars import FUNCTIONS, Scalars


def _total(s: Scalars, nodes: list[int]) -> int:
    out = s.zero
    for node in nodes:
        out = s.add(out, s.number(node))
    return out


def _reduced(r: Recorder, x: Tensor, dim: Any, keepdim: bool, join: Callable[[list[int]], int]) -> Tensor:
    nodes = r.nodes(x)
    dims = list(range(x.dim())) if dim is None or dim == [] else [dim] if isinstance(dim, int) else list(dim)
    dims = sorted(d % max(x.dim(), 1) for d in dims)
    if not x.dim():
        return nodes
    kept = [d for d in range(x.dim()) if d not in dims]
    rows = nodes.permute(*kept, *dims).reshape(*(x.shape[d] for d in kept), -1)
    flat = [join(row) for row in rows.reshape(-1, rows.shape[-1]).tolist()]
    shape = [1 if d in dims else n for d, n in enumerate(x.shape)] if keepdim else [x.shape[d] for d in kept]
    return torch.tensor(flat, dtype=torch.int64).reshape(shape)


def _sum(r: Recorder, x: Tensor, dim: Any = None, keepdim: bool = False, *, dtype: Any = None) -> Tensor:
    return _reduced(r, x, dim, keepdim, lambda row: _total(r.scalars, row))


def _mean(r: Recorder, x: Tensor, dim: Any = None, keepdim: bool = False, *, dtype: Any = None) -> Tensor:
    s = r.scalars
    return _reduced(r, x, dim, keepdim, lambda row: s.div(_total(s, row), s.constant(float(len(row)))))


def _norm(
    r: Recorder, x: Tensor, ord: Any = 2, dim: Any = None, keepdim: bool = False, *, dtype: Any = None
) -> Tensor:
    if ord != 2:
        raise CannotCompile(f"a vector norm of order {ord}")
    s = r.scalars
    return _reduced(r, x, dim, keepdim, lambda row: s.unary("sqrt", _total(s, [s.mul(n, n) for n in row])))


def _extreme(name: str) -> Rule:
    def rule(r: Recorder, x: Tensor, dim: Any = None, keepdim: bool = False) -> Tensor:
        def join(row: list[int]) -> int:
            out = row[0]
            for node in row[1:]:
                out = _largest(r.scalars, out, node, name)
            return out

        return _reduced(r, x, dim, keepdim, join)

    return rule


def _product(s: Scalars, a: Tensor, b: Tensor) -> Tensor:
    """Return the nodes of a matrix product (m, k) (k, n)."""
    left, right = a.tolist(), b.T.tolist()
    flat = []
    for row in left:
        for column in right:
            out = s.zero
            for x, y in zip(row, column, strict=True):
                out = s.add(out, s.mul(x, y))
            flat.append(out)
    return torch.tensor(flat, dtype=torch.int64).reshape(a.shape[0], b.shape[1])


def _mm(r: Recorder, a: Tensor, b: Tensor) -> Tensor:
    return _product(r.scalars, r.nodes(a), r.nodes(b))


def _mv(r: Recorder, a: Tensor, b: Tensor) -> Tensor:
    return _product(r.scalars, r.nodes(a), r.nodes(b).unsqueeze(1)).squeeze(1)


def _dot(r: Recorder, a: Tensor, b: Tensor) -> Tensor:
    return _product(r.scalars, r.nodes(a).unsqueeze(0), r.nodes(b).unsqueeze(1)).reshape(())


def _bmm(r: Recorder, a: Tensor, b: Tensor) -> Tensor:
    return torch.stack([_product(r.scalars, x, y) for x, y in zip(r.nodes(a), r.nodes(b), strict=True)])


def _with_bias(product: Rule) -> Rule:
    def rule(r: Recorder, bias: Tensor, a: Tensor, b: Tensor, *, beta: float = 1, alpha: float = 1) -> Tensor:
        s = r.scalars
        out = product(r, a, b)
        start = r.nodes(bias).expand(out.shape).reshape(-1).tolist()
        flat = [
            s.add(s.mul(s.constant(float(alpha)), n), s.mul(s.constant(float(beta)), b0))
            for n, b0 in zip(out.reshape(-1).tolist(), start, strict=True)
        ]
        return torch.tensor(flat, dtype=torch.int64).reshape(out.shape)

    return rule


def _cross(r: Recorder, a: Tensor, b: Tensor, *, dim: int = -1) -> Tensor:
    s = r.scalars
    x, y = (n.movedim(dim, -1) for n in torch.broadcast_tensors(r.nodes(a), r.nodes(b)))
    flat = [
        [
            s.sub(s.mul(p[(k + 1) % 3], q[(k + 2) % 3]), s.mul(p[(k + 2) % 3], q[(k + 1) % 3]))
            for k in range(3)
        ]
        for p, q in zip(x.reshape(-1, 3).tolist(), y.reshape(-1, 3).tolist(), strict=True)
    ]
    return torch.tensor(flat, dtype=torch.int64).reshape(x.shape).movedim(-1, dim)


def _to_copy(r: Recorder, x: Tensor, **options: Any) -> Tensor:
    kind = options.get("dtype") or x.dtype
    if kind not in (torch.float64, torch.bool) and not r.known(x):
        raise CannotCompile(f"numbers of type {kind}: only double precision is compiled")
    s = r.scalars
    if kind == torch.float64:
        return _each(r, s.number, x)
    return _each(r, lambda n: n if s.is_logical(n) else s.compare("ne", n, s.zero), x)


def _index_put(
    r: Recorder, x: Tensor, indices: Any, values: Tensor, accumulate: bool = False, *_: Any
) -> Tensor:
    for index in tensors([indices]):
        if not r.known(index):
            raise CannotCompile("an index that depends on the state")
    out = r.nodes(x).clone()
    if not accumulate:
        return aten.index_put(out, indices, r.nodes(values))
    where = aten.index(torch.arange(out.numel()).reshape(out.shape), indices)
    flat, s = out.reshape(-1).tolist(), r.scalars
    for place, node in zip(
        where.reshape(-1).tolist(), r.nodes(values).expand(where.shape).reshape(-1).tolist(), strict=True
    ):
        flat[place] = s.add(flat[place], node)
    return torch.tensor(flat, dtype=torch.int64).reshape(out.shape)


def _copy(r: Recorder, x: Tensor, source: Tensor, non_blocking: bool = False) -> Tensor:
    return r.nodes(source).expand(x.shape).clone()


def _fill(r: Recorder, x: Tensor, value: Any) -> Tensor:
    node = r.nodes(value) if isinstance(value, Tensor) else torch.tensor(r.scalars.constant(float(value)))
    return node.expand(x.shape).clone()


RULES: dict[str, Rule] = {
    "add": _add,
    "sub": _sub,
    "rsub": _rsub,
    "mul": _elementwise(lambda s: s.mul, 2),
    "div": _div,
    "remainder": _remainder,
    "neg": _elementwise(lambda s: s.neg, 1),
    "abs": _elementwise(lambda s: s.abs, 1),
    "sgn": _elementwise(lambda s: lambda a: _sign(s, a), 1),
    "sign": _elementwise(lambda s: lambda a: _sign(s, a), 1),
    "rsqrt": _elementwise(lambda s: lambda a: s.div(s.one, s.unary("sqrt", a)), 1),
    "reciprocal": _elementwise(lambda s: lambda a: s.div(s.one, a), 1),
    "sigmoid": _elementwise(lambda s: lambda a: _sigmoid(s, a), 1),
    "relu": _elementwise(lambda s: lambda a: _largest(s, a, s.zero, "max"), 1),
    "pow": _elementwise(lambda s: lambda a, b: _power(s, a, b), 2),
    "atan2": _elementwise(lambda s: lambda a, b: s.binary("atan2", a, b), 2),
    "maximum": _elementwise(lambda s: lambda a, b: _largest(s, a, b, "max"), 2),
    "minimum": _elementwise(lambda s: lambda a, b: _largest(s, a, b, "min"), 2),
    "tanh_backward": _elementwise(lambda s: lambda g, y: s.mul(g, s.sub(s.one, s.mul(y, y))), 2),
    "sigmoid_backward": _elementwise(lambda s: lambda g, y: s.mul(g, s.mul(s.sub(s.one, y), y)), 2),
    "softplus": _softplus,
    "softplus_backward": _softplus_backward,
    "clamp": _clamp,
    "clamp_min": lambda r, x, low: _clamp(r, x, min=low),
    "clamp_max": lambda r, x, high: _clamp(r, x, max=high),
    "where": _where,
    "masked_fill": _masked_fill,
    "lt": _comparison("lt"),
    "le": _comparison("le"),
    "gt": _comparison("lt", swapped=True),
    "ge": _comparison("le", swapped=True),
    "eq": _comparison("eq"),
    "ne": _comparison("ne"),
    "logical_and": _logical(lambda s: s.both),
    "bitwise_and": _logical(lambda s: s.both),
    "logical_or": _logical(lambda s: s.either),
    "bitwise_or": _logical(lambda s: s.either),
    "logical_not": _logical(lambda s: s.negated),
    "bitwise_not": _logical(lambda s: s.negated),
    "sum": _sum,
    "mean": _mean,
    "amax": _extreme("max"),
    "amin": _extreme("min"),
    "linalg_vector_norm": _norm,
    "mm": _mm,
    "mv": _mv,
    "dot": _dot,
    "bmm": _bmm,
    "addmm": _with_bias(_mm),
    "addmv": _with_bias(_mv),
    "baddbmm": _with_bias(_bmm),
    "linalg_cross": _cross,
    "_to_copy": _to_copy,
    "index_put": _index_put,
    "_index_put_impl": _index_put,
    "copy": _copy,
    "fill": _fill,
    "zero": lambda r, x: _fill(r, x, 0.0),
    **{name: _function(name) for name in FUNCTIONS},
}
"""Name of torch's operation to its rule; a trailing underscore (in place) is left out."""
