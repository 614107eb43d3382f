"""What is asked of a group of samples, wherever they lie: a question goes there as bytes, and sums come back."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.damping.base import DampingForm
from auvnn.damping.polynomial import Polynomial
from auvnn.log_chunks.samples import Piece
from auvnn.training.distributed.grouped_sums import group_problems
from auvnn.training.distributed.target_cache import Source, unpack_targets
from auvnn.training.least_squares.linear import triangles
from auvnn.training.least_squares.networks import Normal
from auvnn.training.samples import Samples, error_sums

Array = NDArray[np.float64]
# Groups that a process keeps in memory, 5 MB each.
KEPT = 4


def to_wire(value: Any) -> Any:
    """Return a value with arrays for its tensors, which are sent thirty times faster."""
    if isinstance(value, Tensor):
        return value.numpy()
    if isinstance(value, Normal):
        return Normal, to_wire(value.tensors())
    return tuple(map(to_wire, value)) if isinstance(value, tuple) else value


def from_wire(value: Any) -> Any:
    """Return what `light` was given."""
    if isinstance(value, np.ndarray):
        # What Ray hands over must not be written to.
        return torch.from_numpy(value if value.flags.writeable else value.copy())
    if isinstance(value, tuple) and len(value) == 2 and value[0] is Normal:
        return Normal(*from_wire(value[1]))
    return tuple(map(from_wire, value)) if isinstance(value, tuple) else value


@dataclass(frozen=True)
class Group:
    """Consecutive usable samples.

    Attributes:
        first: number of the first.
        parts: pieces, and which of their usable samples, from and to.
    """

    first: int
    parts: tuple[tuple[Piece, int, int], ...]


_kept: OrderedDict[Any, tuple[Tensor, Tensor, Tensor]] = OrderedDict()


def _group(source: Source, group: Group) -> tuple[Tensor, Tensor, Tensor]:
    """Return velocities, targets and weights of a group, (n, 6) each."""
    key = (source.token, group)
    if key not in _kept:
        rows = np.concatenate([source.samples(piece)[a:b] for piece, a, b in group.parts])
        nu, target = (torch.from_numpy(np.ascontiguousarray(x)) for x in (rows[:, :6], rows[:, 6:]))
        known = torch.isfinite(target)
        _kept[key] = nu, torch.where(known, target, 0.0), known.double()
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
    return _kept[key]


@dataclass(frozen=True)
class Request:
    """What is asked of every group.

    Attributes:
        source: of the samples.
        name: a function of this module.
        thing: what it is about, a form or a bank, as bytes; empty for nothing.
        values: its further arguments, light.
        scales: of the bank, by which samples are divided, light; None: SI units.
    """

    source: Source
    name: str
    thing: bytes = b""
    values: tuple[Any, ...] = ()
    scales: tuple[Array, Array] | None = None


def serve(question: Request, group: Group) -> Any:
    """Answer a question for one group."""
    torch.set_num_threads(1)
    nu, target, weight = _group(question.source, group)
    if question.scales is not None:
        inputs, outputs = from_wire(question.scales)
        nu, target = nu / inputs, target / outputs
    thing = [unpack_targets(question.thing)] if question.thing else []
    return to_wire(
        _ANSWERS[question.name](Samples(nu, target, weight), group.first, *thing, *from_wire(question.values))
    )


def _square(samples: Samples, first: int, share: Tensor) -> tuple[Tensor, Tensor]:
    return samples.nu.square().sum(0), (samples.target * samples.weight / share).square().sum(0)


def _total(samples: Samples, first: int) -> Tensor:
    return (samples.weight * samples.target).sum(0)


def _scatter(samples: Samples, first: int, mean: Tensor) -> Tensor:
    return (samples.weight * (samples.target - mean).square()).sum(0)


def _region(samples: Samples, first: int) -> tuple[Tensor, Tensor]:
    return samples.nu.amin(0), samples.nu.amax(0)


def _triangles(samples: Samples, first: int, form: Polynomial) -> Array:
    return triangles(form, samples.nu, *samples.rows(form.axes))


def _errors(samples: Samples, first: int, bank: DampingBank) -> tuple[Tensor, Tensor]:
    return error_sums(bank, samples)


def _ask(samples: Samples, first: int, form: DampingForm, method: str, *values: Any) -> Any:
    problems = group_problems(form, samples.nu, *samples.rows(form.axes), first)
    return getattr(problems, method)(*values)


_ANSWERS = {
    "square": _square,
    "total": _total,
    "scatter": _scatter,
    "region": _region,
    "triangles": _triangles,
    "errors": _errors,
    "ask": _ask,
}
