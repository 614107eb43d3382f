"""What a model takes besides tensors of its own precision: numpy arrays, lists, and float32."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import torch
from torch import Tensor

from auvnn.errors import ConfigError
from auvnn.models.inputs import Inputs


def as_tensor(value: Any, like: Tensor, name: str) -> Any:
    """Return numbers as a tensor of a model's precision, on its device; tensors of that precision as they are.

    Args:
        value: a tensor, a numpy array, a list, a number, or None, which stays None.
        like: one of the model's own tensors.
        name: what to call it in messages.

    Raises:
        ConfigError: it holds no numbers, or is more precise than the model.
    """
    if value is None:
        return None
    if isinstance(value, Tensor):
        if value.dtype == like.dtype:
            return value
        if value.dtype == torch.float64 and like.dtype != torch.float64:
            raise ConfigError(
                f"{name} is {_plain(value.dtype)} and the model {_plain(like.dtype)}: give {name}.float(), or make the "
                "model double with model.double()"
            )
        # A less precise input loses nothing; its slope goes back the same way.
        return value.to(like.dtype)
    try:
        return torch.as_tensor(value).to(like.dtype).to(like.device)
    except (TypeError, ValueError, RuntimeError) as problem:
        raise ConfigError(
            f"{name} holds no numbers that a tensor can be made of ({problem}); give a tensor, an array or a list"
        ) from None


def as_times(value: Any, like: Tensor) -> Tensor:
    """Return times as a tensor; double ones stay so beside a model of single precision, which would round unix seconds.

    Args:
        value: a tensor, a numpy array or a list, s.
        like: one of the model's own tensors.

    Raises:
        ConfigError: it holds no numbers.
    """
    if isinstance(value, Tensor) and value.dtype == torch.float64:
        return value
    return as_tensor(value, like, "times")


def as_inputs(value: Any, like: Tensor) -> Inputs:
    """Return commands, or all inputs, as tensors of a model's precision."""
    given = value if isinstance(value, Inputs) else Inputs(value)
    made = {f.name: as_tensor(getattr(given, f.name), like, f.name) for f in fields(given)}
    if all(made[f.name] is getattr(given, f.name) for f in fields(given)):
        return given
    return replace(given, **made)


def own(model: Any) -> Tensor:
    """Return one of a model's own tensors, whose precision and device its inputs have."""
    return model.known_mass


def _plain(kind: torch.dtype) -> str:
    return str(kind).removeprefix("torch.")
