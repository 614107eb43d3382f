"""Samples of a fit that are too many for memory: each worker reads its groups of them, and hands back sums."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, reduce
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
from auvnn.log_chunks.samples import Piece
from auvnn.training.distributed.grouped_sums import GROUP, add_all_in_order, add_in_order, grouped
from auvnn.training.distributed.requests import Group, Request, from_wire, serve, to_wire
from auvnn.training.distributed.target_cache import SampleCount, Source, count_samples
from auvnn.training.least_squares.linear import merged
from auvnn.training.least_squares.networks import Problems

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DistributedProblem:
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
    known: tuple[SampleCount, ...]
    size: int = field(default=GROUP)

    @classmethod
    def of(
        cls, pool: Executor, source: Source, pieces: Sequence[Piece], size: int = GROUP
    ) -> DistributedProblem:
        """Work out the samples of pieces.

        Args:
            pool: does it piece by piece.
            source: of samples: model, mapping and derivative.
            pieces: of the files.
            size: about how many samples make a group.

        Raises:
            InputError: none of them can be used.
        """
        known = tuple(pool.run(count_samples, source, list(pieces)))
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

    def split(self, held_out: Collection[int]) -> tuple[DistributedProblem, DistributedProblem]:
        """Return the problems without and with the runs that are held out."""
        return self._of_runs(held_out, False), self._of_runs(held_out, True)

    def _of_runs(self, runs: Collection[int], wanted: bool) -> DistributedProblem:
        some = [(p, k) for p, k in zip(self.pieces, self.known, strict=True) if (p.run in runs) == wanted]
        return DistributedProblem(
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
                "correct the log, or give the form 'zero' there"
            )

    def mean_squares(self) -> tuple[Tensor, Tensor]:
        """Return the mean squares (6,) of velocities and of targets, of these over the samples that count."""
        share = (self.counts / self.samples).clamp_min(1e-300).sqrt()
        nu, target = add_all_in_order(self.ask("square", share))
        return nu / self.samples, target / self.samples

    def spread(self) -> Tensor:
        """Return the standard deviation of the target by degree of freedom (6,), N and N m."""
        total = self.counts.clamp_min(1e-300)
        mean = add_in_order(self.ask("total")) / total
        return (add_in_order(self.ask("scatter", mean)) / total).sqrt()

    def region(self) -> Region | None:
        """Return the velocities that the samples fill."""
        bounds = list(self.ask("region"))
        low, high = torch.stack([b[0] for b in bounds]), torch.stack([b[1] for b in bounds])
        return Region(tuple(low.amin(0).tolist()), tuple(high.amax(0).tolist()))

    def scaled(self, bank: DampingBank) -> DistributedSamples:
        """Return the samples divided by a bank's scales."""
        return DistributedSamples(self, (bank.input_scale.cpu().double(), bank.output_scale.cpu().double()))

    def fingerprint(self) -> str:
        """Return the SHA-256 of everything that the fit is given."""
        digest = hashlib.sha256()
        for piece, known in zip(self.pieces, self.known, strict=True):
            digest.update(f"{piece.run} {known.samples} {known.digest}\n".encode())
        return digest.hexdigest()

    def ask(
        self, name: str, *values: Any, thing: bytes = b"", scales: tuple[Tensor, Tensor] | None = None
    ) -> Iterator[Any]:
        """Ask every group, and yield the answers in the order of the groups; see `Question`.

        Args:
            name: of what is asked.
            thing: what else it depends on, as bytes.
            scales: of inputs and outputs, or None.
            *values: that it depends on.
        """
        question = Request(self.source, name, thing, to_wire(values), to_wire(scales))
        return map(from_wire, self.pool.run(serve, question, self.groups))


@dataclass(frozen=True, eq=False)
class DistributedSamples:
    """The samples of a fit as `Samples` promises them, wherever they are.

    Attributes:
        problem: of which they are the samples.
        scales: by which they are divided.
    """

    problem: DistributedProblem
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
        square, weight = add_all_in_order(self.problem.ask("errors", thing=pack(bank), scales=self.scales))
        return square, weight
