"""What to do about each of torch's operations: compute, move elements, follow a view, or refuse."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch._decomp import decomposition_table

from auvnn.compiled.elementwise import aten
from auvnn.compiled.operations import RULES
from auvnn.compiled.recorder import CannotCompile, Recorder, tensors

# Move elements without computing: done by torch itself on the nodes' numbers; what they fill in is zero, node 0.
MOVES = frozenset(
    (  # noqa: SIM905
        "cat stack clone contiguous index_select gather flip roll "
        "repeat tril triu select_backward slice_backward diagonal_backward unfold_backward lift_fresh_copy "
        "lift_fresh select_scatter slice_scatter diagonal_scatter diag_embed take_along_dim expand_copy view_copy "
        "permute_copy unsqueeze_copy index constant_pad_nd "
    ).split()
)

# Their result does not depend on the values of what they are given.
BLIND = frozenset(
    (  # noqa: SIM905
        "zeros_like ones_like full_like empty_like new_zeros new_ones new_full new_empty new_empty_strided "
        "zeros ones full empty empty_strided arange eye scalar_tensor linspace "
    ).split()
)

# Take numbers out of tensors, or make shapes depend on them.
READS = frozenset(
    ["_local_scalar_dense", "is_nonzero", "equal", "nonzero", "item", "masked_select", "unique", "_unique2"]
)


def _move(r: Recorder, func: Any, args: tuple[Any, ...], kwargs: dict) -> Tensor:
    """Let torch move the nodes' numbers as it moves the elements."""
    name = func._schema.name.removeprefix("aten::")
    if name == "constant_pad_nd":
        given: list[Any] = [
            *args,
            kwargs.get("value", 0),
        ]  # x, padding, and the value if it was given by place
        return aten.constant_pad_nd(r.nodes(given[0]), given[1], r.scalars.constant(float(given[2])))
    positions = {"index_select": (2,), "gather": (2,), "index": (1,)}.get(name, ())

    def swapped(value: Any) -> Any:
        if isinstance(value, Tensor):
            return r.nodes(value)
        if isinstance(value, (list, tuple)):
            return [swapped(v) for v in value]
        return value

    for place in positions:
        if not all(r.known(t) for t in tensors([args[place]])):
            raise CannotCompile("an index that depends on the state")
    moved = [a if k in positions else swapped(a) for k, a in enumerate(args)]
    return func(*moved, **{k: v for k, v in kwargs.items() if k == "memory_format"})


def _inverse(r: Recorder, out: Any, x: Tensor) -> None:
    size = x.shape[-1]
    nodes = r.nodes(x).reshape(-1, size * size).tolist()
    made = torch.tensor([r.scalars.inverse(one, size) for one in nodes], dtype=torch.int64)
    r.write(out[0], made.reshape(x.shape))


def apply(r: Recorder, func: Any, args: tuple, kwargs: dict) -> Any:
    """Run one operation for real and in the graph.

    Args:
        r: keeps the graph.
        func: the operation, an overload of `torch.ops.aten`.
        args: its positional arguments, tensors among them.
        kwargs: its keyword arguments.

    Raises:
        CannotCompile: there is no rule for it, or what it does depends on the values of the state.
    """
    name = func._schema.name.removeprefix("aten::")
    given = tensors([*args, *kwargs.values()])
    followed = [t for t in given if not r.known(t)]
    if followed and name in READS:
        raise CannotCompile(
            "control flow, or a number read out of a tensor, that depends on the state or on weights"
        )
    mutable = func._schema.is_mutable
    if mutable and (not args or not isinstance(args[0], Tensor) or "out" in kwargs):
        raise CannotCompile(f"torch's operation {func}")
    # Before it runs: an operation in place changes what a constant was.
    target = args[0] if mutable else None
    if target is not None and not _views(func) and r.is_given(target):
        raise CannotCompile("a state, an input, a parameter or a buffer is changed in place")
    if target is not None and not _views(func) and (followed or r.followed(target)):
        r.adopt(target)
    plain = name[:-1] if mutable and name.endswith("_") else name
    fresh = plain in RULES or plain in MOVES or plain == "linalg_inv_ex"
    nodes = None
    if plain in RULES and (followed or (target is not None and r.followed(target))):
        if any(t.dtype not in (torch.float64, torch.bool) for t in followed):
            raise CannotCompile("only double precision is compiled")
        nodes = RULES[plain](r, *args, **_meaningful(kwargs, plain))
    elif plain in MOVES and followed:
        nodes = _move(r, func, args, kwargs)
    elif target is not None and r.followed(target) and not _views(func):
        raise CannotCompile(f"torch's operation {func}")
    elif followed and not fresh and name not in BLIND and not _views(func):
        table: Any = decomposition_table
        if func in table and not mutable:
            with r:
                return table[func](*args, **kwargs)
        raise CannotCompile(f"torch's operation {func}")
    out = func(*args, **kwargs)
    made = tensors([out])
    r.keep(made)
    if plain == "linalg_inv_ex" and followed:
        _inverse(r, out, args[0])
    elif nodes is not None:
        r.write(out if target is None else target, nodes.reshape(out.shape))
    elif any(r.followed(t) for t in given):
        # Nothing of it depends on the inputs any more: constants, though autograd does not know.
        for one in made:
            r.adopt(one)
    return out


def _meaningful(kwargs: dict, name: str) -> dict:
    """Return the options without those that only say where and how a result is stored."""
    if name == "_to_copy":
        return {"dtype": kwargs.get("dtype")}
    return {
        k: v for k, v in kwargs.items() if k not in ("memory_format", "out", "layout", "device", "pin_memory")
    }


def _views(func: Any) -> bool:
    """Return whether an operation gives a view of its argument (or the argument itself)."""
    name = func._schema.name.removeprefix("aten::")
    if name in ("_linalg_check_errors", "_unsafe_view") or (name.endswith("_") and name[:-1] in _SHAPES):
        return True
    return any(x.alias_info is not None and not x.alias_info.is_write for x in func._schema.arguments)


_SHAPES = frozenset(
    ["squeeze", "unsqueeze", "t", "transpose", "detach", "as_strided", "swapaxes", "requires_grad"]
)
