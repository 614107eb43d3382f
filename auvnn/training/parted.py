"""Samples of a fit that are too many for memory: each worker reads its groups of them, and hands back sums.

What the subnetworks should give is worked out once for each piece of the log and kept in a scratch folder, 96 bytes a
sample. A worker that finds nothing there (on another machine, or because it was cleared) works it out again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import tempfile
import uuid
from collections import OrderedDict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, reduce
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.damping.base import AXES, DampingForm
from auvnn.damping.polynomial import Polynomial
from auvnn.damping.region import Region
from auvnn.errors import InputError
from auvnn.executors import Executor
from auvnn.executors.packing import pack
from auvnn.logs.mapping import Mapping
from auvnn.metrics.one_step import Derivative
from auvnn.metrics.pieces import Piece, inside, run_of
from auvnn.models import GreyBox
from auvnn.training.groups import GROUP, added, added_all, group_problems, grouped
from auvnn.training.linear import merged, triangles
from auvnn.training.networks import Normal, Problems
from auvnn.training.samples import Samples, error_sums
from auvnn.training.targets import Targets

Array = NDArray[np.float64]
# Groups that a process keeps in memory, 5 MB each.
KEPT = 4


def light(value: Any) -> Any:
    """Return a value with arrays for its tensors, which are sent thirty times faster."""
    if isinstance(value, Tensor):
        return value.numpy()
    if isinstance(value, Normal):
        return Normal, light(value.tensors())
    return tuple(map(light, value)) if isinstance(value, tuple) else value


def heavy(value: Any) -> Any:
    """Return what `light` was given."""
    if isinstance(value, np.ndarray):
        # What Ray hands over must not be written to.
        return torch.from_numpy(value if value.flags.writeable else value.copy())
    if isinstance(value, tuple) and len(value) == 2 and value[0] is Normal:
        return Normal(*heavy(value[1]))
    return tuple(map(heavy, value)) if isinstance(value, tuple) else value


_own: dict[str, tempfile.TemporaryDirectory[str]] = {}


@lru_cache(maxsize=16)
def unpacked(data: bytes) -> Any:
    """Return what was packed; many questions hold the same."""
    return pickle.loads(data)


@dataclass(frozen=True)
class Source:
    """Where the samples of pieces come from.

    Attributes:
        packed: model, derivative and mapping, as bytes: they are sent with every question.
        scratch: folder for what was worked out; a process that does not see it takes one of its own.
        token: another one for each training.
    """

    packed: bytes
    scratch: Path
    token: str

    @classmethod
    def of(cls, model: GreyBox, derivative: Derivative, mapping: Mapping, scratch: Path) -> Source:
        """Return a source.

        Args:
            model: its damping subnetworks do not count.
            derivative: how accelerations are obtained.
            mapping: of the columns.
            scratch: folder for what is worked out.
        """
        return cls(pack((model, derivative, mapping)), scratch, uuid.uuid4().hex)

    def samples(self, piece: Piece) -> Array:
        """Return velocity and target of a piece's samples that can be used, (n, 12); NaN where a target is missing."""
        place = self._folder() / f"{piece.name}.npy"
        try:
            return np.load(place)
        except (OSError, ValueError):
            pass
        found = self.worked_out(piece)
        unfinished = place.with_suffix(f".{os.getpid()}.partial")
        with unfinished.open("wb") as stream:
            np.save(stream, found)
        unfinished.replace(place)
        return found

    def _folder(self) -> Path:
        if self.scratch.is_dir():
            return self.scratch
        # On another machine: a folder that goes with this process.
        if self.token not in _own:
            _own[self.token] = tempfile.TemporaryDirectory(prefix="auvnn-")
        return Path(_own[self.token].name)

    def worked_out(self, piece: Piece) -> Array:
        """Return what `samples` does, from the log itself."""
        model, derivative, mapping = unpacked(self.packed)
        run = run_of(piece, mapping)
        nu, target = Targets(model, derivative)(run, piece.opening)
        mine = inside(piece, run)
        found = np.concatenate([nu[mine], target[mine]], axis=1)
        good = np.isfinite(found[:, :6]).all(1)
        found[:, 6:][~np.isfinite(found[:, 6:])] = np.nan
        return found[good & np.isfinite(found[:, 6:]).any(1)]


@dataclass(frozen=True)
class Group:
    """Consecutive usable samples.

    Attributes:
        first: number of the first.
        parts: pieces, and which of their usable samples, from and to.
    """

    first: int
    parts: tuple[tuple[Piece, int, int], ...]


@dataclass(frozen=True)
class Counted:
    """What is known of a piece's usable samples: how many, by degree of freedom, and a digest of them."""

    samples: int
    counts: tuple[int, ...]
    digest: str


def counted(source: Source, piece: Piece) -> Counted:
    """Work out a piece's samples and count them."""
    torch.set_num_threads(1)
    found = source.samples(piece)
    counts = np.isfinite(found[:, 6:]).sum(0)
    return Counted(len(found), tuple(counts.tolist()), hashlib.sha256(found.tobytes()).hexdigest())


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
class Question:
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


def answer(question: Question, group: Group) -> Any:
    """Answer a question for one group."""
    torch.set_num_threads(1)
    nu, target, weight = _group(question.source, group)
    if question.scales is not None:
        inputs, outputs = heavy(question.scales)
        nu, target = nu / inputs, target / outputs
    thing = [unpacked(question.thing)] if question.thing else []
    return light(
        _ANSWERS[question.name](Samples(nu, target, weight), group.first, *thing, *heavy(question.values))
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


@dataclass(frozen=True, eq=False)
class PartedProblem:
    """A `DampingProblem` of samples that are in pieces of a log; all weights are one or zero.

    Attributes:
        pool: who computes.
        source: of the samples.
        pieces: in order.
        known: what is known of each.
        size: of a group.
    """

    pool: Executor
    source: Source
    pieces: tuple[Piece, ...]
    known: tuple[Counted, ...]
    size: int = field(default=GROUP)

    @classmethod
    def of(cls, pool: Executor, source: Source, pieces: Sequence[Piece], size: int = GROUP) -> PartedProblem:
        """Work out the samples of pieces.

        Raises:
            InputError: none of them can be used.
        """
        known = tuple(pool.run(counted, source, list(pieces)))
        if not sum(k.samples for k in known):
            raise InputError(
                "damping problem: no sample is finite, valid and of positive weight: nothing to fit"
            )
        return cls(pool, source, tuple(pieces), known, size)

    @property
    def samples(self) -> int:
        """Number of samples that count in at least one degree of freedom."""
        return sum(k.samples for k in self.known)

    @cached_property
    def counts(self) -> Tensor:
        """Samples that count, by degree of freedom, (6,)."""
        return torch.tensor([k.counts for k in self.known], dtype=torch.float64).sum(0)

    @cached_property
    def groups(self) -> list[Group]:
        """The groups of which all sums are made."""
        found: list[Group] = []
        parts: list[tuple[Piece, int, int]] = []
        first = filled = 0
        for piece, known in zip(self.pieces, self.known, strict=True):
            at = 0
            while at < known.samples:
                take = min(known.samples - at, self.size - filled)
                parts.append((piece, at, at + take))
                at, filled = at + take, filled + take
                if filled == self.size:
                    found.append(Group(first, tuple(parts)))
                    first, filled, parts = first + filled, 0, []
        return [*found, Group(first, tuple(parts))] if parts else found

    def split(self, held_out: Collection[int]) -> tuple[PartedProblem, PartedProblem]:
        """Return the problems without and with the runs that are held out."""
        return self._of_runs(held_out, False), self._of_runs(held_out, True)

    def _of_runs(self, runs: Collection[int], wanted: bool) -> PartedProblem:
        some = [(p, k) for p, k in zip(self.pieces, self.known, strict=True) if (p.run in runs) == wanted]
        return PartedProblem(
            self.pool, self.source, tuple(p for p, _ in some), tuple(k for _, k in some), self.size
        )

    def check_axes(self, axes: Collection[int]) -> None:
        """Refuse to fit degrees of freedom for which no sample counts.

        Raises:
            InputError: there is such a degree of freedom among `axes`.
        """
        empty = [AXES[axis] for axis in axes if not self.counts[axis] > 0]
        if empty:
            raise InputError(
                f"damping problem: no usable sample for {', '.join(empty)}: "
                "mend the log, or give the form 'zero' there"
            )

    def mean_squares(self) -> tuple[Tensor, Tensor]:
        """Return the mean squares (6,) of velocities and of targets, of these over the samples that count."""
        share = (self.counts / self.samples).clamp_min(1e-300).sqrt()
        nu, target = added_all(self.ask("square", share))
        return nu / self.samples, target / self.samples

    def spread(self) -> Tensor:
        """Return the standard deviation of the target by degree of freedom (6,), N and N m."""
        total = self.counts.clamp_min(1e-300)
        mean = added(self.ask("total")) / total
        return (added(self.ask("scatter", mean)) / total).sqrt()

    def region(self) -> Region | None:
        """Return the velocities that the samples fill."""
        bounds = list(self.ask("region"))
        low, high = torch.stack([b[0] for b in bounds]), torch.stack([b[1] for b in bounds])
        return Region(tuple(low.amin(0).tolist()), tuple(high.amax(0).tolist()))

    def scaled(self, bank: DampingBank) -> PartedSamples:
        """Return the samples divided by a bank's scales."""
        return PartedSamples(self, (bank.input_scale.cpu().double(), bank.output_scale.cpu().double()))

    def fingerprint(self) -> str:
        """Return the SHA-256 of everything that the fit is given."""
        digest = hashlib.sha256()
        for piece, known in zip(self.pieces, self.known, strict=True):
            digest.update(f"{piece.run} {known.samples} {known.digest}\n".encode())
        return digest.hexdigest()

    def ask(
        self, name: str, *values: Any, thing: bytes = b"", scales: tuple[Tensor, Tensor] | None = None
    ) -> Iterator[Any]:
        """Ask every group, and yield the answers in the order of the groups; see `Question`."""
        question = Question(self.source, name, thing, light(values), light(scales))
        return map(heavy, self.pool.run(answer, question, self.groups))


@dataclass(frozen=True, eq=False)
class PartedSamples:
    """The samples of a fit as `Samples` promises them, wherever they are.

    Attributes:
        problem: of which they are the samples.
        scales: by which they are divided.
    """

    problem: PartedProblem
    scales: tuple[Tensor, Tensor]

    def problems(self, form: DampingForm) -> Problems:
        """Return the least-squares problems of a form."""
        thing = pack(form)

        def ask(method: str, *values: Any) -> Iterator[Any]:
            return self.problem.ask("ask", method, *values, thing=thing, scales=self.scales)

        return grouped(form, ask, self.problem.samples, self.problem.counts[list(form.axes)])

    def triangles(self, form: Polynomial) -> Array:
        """Return what the samples say about the coefficients of a polynomial."""
        found = self.problem.ask("triangles", thing=pack(form), scales=self.scales)
        return reduce(merged, (f.numpy() for f in found))

    def error_sums(self, bank: DampingBank) -> tuple[Tensor, Tensor]:
        """Return the sums of the squared error of a bank, and of the samples that count, (6,) each."""
        square, weight = added_all(self.problem.ask("errors", thing=pack(bank), scales=self.scales))
        return square, weight
