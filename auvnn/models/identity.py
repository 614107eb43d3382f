"""What a model's right-hand side depends on besides its parameters and buffers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from torch import Tensor, nn

# What torch itself keeps in a module. Parameters and buffers are inputs of compiled code, but for their shapes.
OWN = frozenset(
    (  # noqa: SIM905
        "_parameters _buffers _modules "
        "_non_persistent_buffers_set _backward_pre_hooks _backward_hooks "
        "_is_full_backward_hook _forward_hooks _forward_hooks_with_kwargs "
        "_forward_hooks_always_called _forward_pre_hooks _forward_pre_hooks_with_kwargs "
        "_state_dict_hooks _state_dict_pre_hooks _load_state_dict_pre_hooks "
        "_load_state_dict_post_hooks "
    ).split()
)
DEEPEST = 6
PLAIN = (type(None), bool, int, float, str, bytes)


class Identity:
    """A key that changes whenever something changes that compiled code has taken as constant.

    Plain numbers, texts, lists, frozen records of them and small arrays count by value, parts of the model by name,
    tensors by identity and version, everything else by identity; what counts by identity is held, so that no other
    object gets its address. Not seen is what changes in a module's globals, or inside an object that is frozen or
    callable.

    Args:
        model: module whose own attributes and parts count.
    """

    def __init__(self, model: nn.Module) -> None:
        """Walk through the model."""
        self.held: list[Any] = []
        self._names = {id(module): name for name, module in model.named_modules()}
        parts: list[Any] = []
        for name, module in model.named_modules():
            own = tuple((k, self._of(v, 0)) for k, v in module.__dict__.items() if k not in OWN)
            parts.append((name, type(module), own))
        for name, tensor in (*model.named_parameters(), *model.named_buffers()):
            parts.append(
                (
                    name,
                    tuple(tensor.shape),
                    tensor.dtype,
                    tensor.requires_grad,
                    isinstance(tensor, nn.Parameter),
                )
            )
        self.key = tuple(parts)

    def _of(self, value: Any, depth: int) -> Any:
        if value is None or isinstance(value, (bool, int, float, str, bytes, type)):
            # 1, 1.0 and True are equal, and NaN is not equal to itself.
            return (type(value), repr(value) if isinstance(value, float) else value)
        if id(value) in self._names:
            return ("part", self._names[id(value)])
        self.held.append(value)
        if isinstance(value, Tensor):
            return ("tensor", id(value), value._version)
        if isinstance(value, np.ndarray) and value.dtype != object:
            return (
                "array",
                value.shape,
                value.dtype.str,
                value.tobytes() if value.size <= 4096 else id(value),
            )
        if depth < DEEPEST:
            if isinstance(value, (list, tuple)):
                return (type(value), tuple(self._of(v, depth + 1) for v in value))
            if isinstance(value, dict):
                return (
                    dict,
                    tuple((self._of(k, depth + 1), self._of(v, depth + 1)) for k, v in value.items()),
                )
            if isinstance(value, (set, frozenset)):
                return (type(value), frozenset(self._of(v, depth + 1) for v in value))
            frozen = dataclasses.is_dataclass(value) and value.__dataclass_params__.frozen  # type: ignore[attr-defined]
            if frozen and all(_plain(v) for v in vars(value).values()):
                # A copied effect's description of a parameter is a copy too.
                return (type(value), tuple((k, self._of(v, depth + 1)) for k, v in vars(value).items()))
            if (
                not frozen
                and not isinstance(value, nn.Module)
                and hasattr(value, "__dict__")
                and not callable(value)
            ):
                return (id(value), self._of(vars(value), depth + 1))
        return id(value)


def _plain(value: Any) -> bool:
    return isinstance(value, PLAIN) or (isinstance(value, tuple) and all(isinstance(v, PLAIN) for v in value))


def has_hooks(model: nn.Module) -> bool:
    """Return whether anything is hooked into a module's calls: it would run once, at tracing, and never again."""
    return any(
        getattr(module, name)
        for module in model.modules()
        for name in ("_forward_hooks", "_forward_pre_hooks", "_backward_hooks", "_backward_pre_hooks")
    )
