"""What a damping fit is given: velocities, the damping they should give, and how much each sample counts."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.damping.base import AXES
from auvnn.damping.region import Region
from auvnn.errors import ConfigError, InputError
from auvnn.training.distributed.grouped_sums import column_sums
from auvnn.training.samples import Samples


@dataclass(frozen=True, eq=False)
class DampingProblem:
    """One-step targets of the damping, free of any vehicle: find d with d(nu) = target.

    A sample that is NaN or infinite does not count, nor does one that `valid` leaves out.

    Args:
        nu: velocity relative to the water (N, 6), m/s and rad/s.
        target: wrench that the damping should have, on the left-hand side (N, 6), N and N m.
        weight: weight of the squared error, (6,) or (N, 6), not negative; default ones.
        run: run number of each sample (N,); default all in run 0.
        valid: which samples count, (N,) or (N, 6); default all.

    Raises:
        InputError: shapes that do not fit together, a negative weight, or no usable sample.
    """

    nu: Tensor
    target: Tensor
    weight: Tensor | None = None
    run: Tensor | None = None
    valid: Tensor | None = None

    def __post_init__(self) -> None:
        """Check the shapes and fold what is missing or unusable into the weights."""
        nu, target = _floats(self.nu, "nu"), _floats(self.target, "target")
        if nu.ndim != 2 or nu.shape[1] != 6 or target.shape != nu.shape:
            raise InputError(
                f"damping problem: nu has shape {tuple(nu.shape)}, target {tuple(target.shape)}: "
                "both must be (N, 6)"
            )
        n = len(nu)
        usable = torch.isfinite(target) & torch.isfinite(nu).all(1, keepdim=True)
        if self.valid is not None:
            valid = torch.as_tensor(self.valid).to(torch.bool)
            if valid.shape not in ((n,), (n, 6)):
                raise InputError(
                    f"damping problem: valid has shape {tuple(valid.shape)}: give ({n},) or ({n}, 6)"
                )
            usable &= valid if valid.ndim == 2 else valid[:, None]
        weight = torch.ones(n, 6, dtype=torch.float64)
        if self.weight is not None:
            given = _floats(self.weight, "weight")
            if given.shape not in ((6,), (n, 6)):
                raise InputError(
                    f"damping problem: weight has shape {tuple(given.shape)}: give (6,) or ({n}, 6)"
                )
            if bool((given < 0).any()) or not bool(torch.isfinite(given).all()):
                raise InputError("damping problem: a weight is negative, NaN or infinite: give zero or more")
            weight = weight * given
        run = torch.zeros(n, dtype=torch.int64)
        if self.run is not None:
            run = torch.as_tensor(self.run).to(torch.int64)
            if run.shape != (n,):
                raise InputError(f"damping problem: run has shape {tuple(run.shape)}: give ({n},)")
        weight = torch.where(usable, weight, 0.0)
        counts = (weight > 0).any(1)
        if not bool(counts.any()):
            raise InputError(
                "damping problem: no sample is finite, valid and of positive weight: nothing to fit"
            )
        tidy = {
            "nu": nu[counts],
            "target": torch.where(usable, target, 0.0)[counts],
            "weight": weight[counts],
            "run": run[counts],
            "valid": usable[counts],
        }
        for name, value in tidy.items():
            object.__setattr__(self, name, value.contiguous())

    @property
    def samples(self) -> int:
        """Number of samples that count in at least one degree of freedom."""
        return len(self.nu)

    @property
    def weights(self) -> Tensor:
        """Weights (N, 6), zero where a sample does not count."""
        assert self.weight is not None  # set in __post_init__
        return self.weight

    @property
    def runs(self) -> list[int]:
        """Run numbers, increasing."""
        assert self.run is not None  # set in __post_init__
        return sorted(int(number) for number in torch.unique(self.run))

    def spread(self) -> Tensor:
        """Return the weighted standard deviation of the target by degree of freedom (6,), N and N m."""
        weight, total = self.weights, column_sums(self.weights).clamp_min(1e-300)
        mean = column_sums(weight * self.target) / total
        return (column_sums(weight * (self.target - mean).square()) / total).sqrt()

    def mean_squares(self) -> tuple[Tensor, Tensor]:
        """Return the mean squares (6,) of velocities and of targets, of these over the samples that count."""
        counted = (self.weights > 0).double()
        share = (column_sums(counted) / self.samples).clamp_min(1e-300).sqrt()
        square = column_sums((self.target * counted / share).square())
        return column_sums(self.nu.square()) / self.samples, square / self.samples

    def region(self) -> Region | None:
        """Return the velocities that the samples fill."""
        return Region.of(self.nu)

    def scaled(self, bank: DampingBank) -> Samples:
        """Return the samples divided by a bank's scales."""
        return Samples.scaled(self, bank)

    def select(self, rows: Tensor) -> DampingProblem:
        """Return the problem of some samples, given by a mask (N,)."""
        assert self.run is not None and self.valid is not None  # set in __post_init__
        return DampingProblem(
            self.nu[rows], self.target[rows], self.weights[rows], self.run[rows], self.valid[rows]
        )

    def split(self, held_out: Collection[int]) -> tuple[DampingProblem, DampingProblem]:
        """Return the problems without and with the runs that are held out.

        Raises:
            ConfigError: a run is not there, or no run would be left to fit.
        """
        there = self.runs
        strange = sorted(set(held_out) - set(there))
        if strange:
            raise ConfigError(
                f"held_out names run {strange[0]}, but there are only {there}: name one of those"
            )
        if set(held_out) >= set(there):
            raise ConfigError(f"held_out takes all runs {there}: leave at least one to fit")
        assert self.run is not None  # set in __post_init__
        held = torch.isin(self.run, torch.tensor(sorted(held_out), dtype=torch.int64))
        return self.select(~held), self.select(held)

    def fingerprint(self) -> str:
        """Return the SHA-256 of everything that the fit is given."""
        digest = hashlib.sha256()
        for tensor in (self.nu, self.target, self.weight, self.run):
            assert tensor is not None  # set in __post_init__
            digest.update(str((tuple(tensor.shape), tensor.dtype)).encode())
            digest.update(tensor.numpy().tobytes())
        return digest.hexdigest()

    def check_axes(self, axes: Collection[int]) -> None:
        """Refuse to fit degrees of freedom for which no sample counts.

        Raises:
            InputError: there is such a degree of freedom among `axes`.
        """
        empty = [AXES[axis] for axis in axes if not bool((self.weights[:, axis] > 0).any())]
        if empty:
            raise InputError(
                f"damping problem: no usable sample for {', '.join(empty)}: "
                "correct the log, or give the form 'zero' there"
            )


def _floats(value: Any, what: str) -> Tensor:
    try:
        return torch.as_tensor(value).detach().cpu().to(torch.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        raise InputError(f"damping problem: {what} is not an array of numbers ({error})") from error
