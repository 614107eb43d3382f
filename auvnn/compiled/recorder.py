"""Watch torch evaluate a function once, and write down which scalar operations that took."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from auvnn.compiled.scalars import Scalars


class CannotCompile(Exception):
    """A function does something that is not covered; the message says what."""


class Recorder(TorchDispatchMode):
    """A dispatch mode that follows tensors through torch's basic operations, element by element.

    Below autograd, so that what `torch.autograd.grad` does inside is recorded like anything else. Each storage is
    mirrored by one of scalar nodes: views, in-place writing and strides then need no separate rules.

    Tensors that were not declared by `track` count as constants.

    Args:
        scalars: graph to write to.
        apply: what to do about each operation: (recorder, function, arguments, keywords) to its result.
    """

    def __init__(self, scalars: Scalars, apply: Callable[[Recorder, Any, tuple, dict], Any]) -> None:
        """Start without tensors."""
        super().__init__()
        self.apply = apply
        self.scalars = scalars
        self._nodes: dict[int, Tensor] = {}
        self._given: set[int] = set()
        # Storages are told apart by address: none may be freed while we look.
        self._alive: list[Tensor] = []

    def track(self, tensor: Tensor, nodes: Sequence[int]) -> Tensor:
        """Declare a contiguous tensor's elements to be the given nodes."""
        self._alive.append(tensor)
        self._given.add(tensor.untyped_storage()._cdata)
        self._nodes[tensor.untyped_storage()._cdata] = torch.tensor(list(nodes), dtype=torch.int64)
        return tensor

    def is_given(self, tensor: Tensor) -> bool:
        """Return whether a tensor is a view of a declared one: of the state, an input or a parameter."""
        return tensor.untyped_storage()._cdata in self._given

    def nodes(self, tensor: Tensor) -> Tensor:
        """Return the nodes of a tensor's elements, int64 of the same shape; constants for an unknown tensor."""
        storage = self._nodes.get(tensor.untyped_storage()._cdata)
        if storage is not None:
            return storage.as_strided(tensor.shape, tensor.stride(), tensor.storage_offset())
        if tensor.requires_grad:
            raise CannotCompile("a tensor that is neither parameter nor buffer nor input requires a gradient")
        return self._constants(tensor)

    def _constants(self, tensor: Tensor) -> Tensor:
        if tensor.is_complex():
            raise CannotCompile("complex numbers")
        # int64 beyond 2**53 would lose digits, but no such number reaches physics.
        values = tensor.detach().reshape(-1).tolist()
        made = [self.scalars.constant(v if isinstance(v, bool) else float(v)) for v in values]
        return torch.tensor(made, dtype=torch.int64).reshape(tensor.shape)

    def known(self, tensor: Tensor) -> bool:
        """Return whether all elements are constants."""
        if tensor.untyped_storage()._cdata not in self._nodes:
            return not tensor.requires_grad
        return all(self.scalars.is_constant(n) for n in self.nodes(tensor).reshape(-1).tolist())

    def followed(self, tensor: Tensor) -> bool:
        """Return whether the tensor's storage has nodes, though they be constants."""
        return tensor.untyped_storage()._cdata in self._nodes

    def keep(self, tensors: Sequence[Tensor]) -> None:
        """Hold tensors until the end, so that no other storage gets their address."""
        self._alive += tensors

    def adopt(self, tensor: Tensor) -> None:
        """Give the whole storage of a tensor nodes, constants, because part of it is about to be written."""
        if not self.followed(tensor):
            whole = torch.empty(0, dtype=tensor.dtype).set_(tensor.untyped_storage())
            self._alive.append(tensor)
            self._nodes[tensor.untyped_storage()._cdata] = self._constants(whole)

    def write(self, tensor: Tensor, nodes: Tensor) -> None:
        """Say what a tensor's elements are from now on."""
        key = tensor.untyped_storage()._cdata
        if key not in self._nodes:
            size = tensor.untyped_storage().nbytes() // tensor.element_size()
            self._nodes[key] = torch.zeros(size, dtype=torch.int64)
            self._alive.append(tensor)
        storage = self._nodes[key]
        storage.as_strided(tensor.shape, tensor.stride(), tensor.storage_offset()).copy_(nodes)

    def __torch_dispatch__(self, func: Any, types: Any, args: tuple = (), kwargs: dict | None = None) -> Any:
        """Run an operation and note what it did to the tracked elements."""
        return self.apply(self, func, args, kwargs or {})


def tensors(values: Any) -> list[Tensor]:
    """Return the tensors among arguments, lists of them included."""
    found = []
    for value in values:
        if isinstance(value, Tensor):
            found.append(value)
        elif isinstance(value, (list, tuple)):
            found += tensors(value)
    return found
