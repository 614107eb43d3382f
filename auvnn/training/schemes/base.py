"""What every training scheme promises: steps that can be saved after any of them and taken up again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.training.samples import Samples, SampleSums

__all__ = ["SampleSums", "Samples", "Scheme", "SchemeTask", "State", "positive", "relative_errors", "whole"]


@dataclass(frozen=True)
class SchemeTask:
    """What a scheme works on.

    Args:
        bank: a copy of the bank with its scales set; the scheme leaves its answer in it.
        train: samples to fit.
        held_out: samples to judge by, or None.
        spread: (6,) scaled standard deviation of the training targets, ones where that is zero.
        seed: of everything that is drawn.
        warm: start from the bank's weights rather than from drawn ones.
    """

    bank: DampingBank
    train: SampleSums
    held_out: SampleSums | None
    spread: Tensor
    seed: int
    warm: bool


State = tuple[dict[str, Tensor], dict[str, Any]]


class Scheme:
    """A way to find the parameters of a bank, one iteration at a time.

    A scheme that asks of its samples sums alone, by the methods of `Samples`, says so by `sums_suffice`: it can then fit
    logs larger than the memory, and many files.
    """

    name: ClassVar[str]
    sums_suffice: ClassVar[bool] = False
    warnings: list[str]

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme, as plain data."""
        raise TypeError(f"training scheme '{type(self).__name__}' does not state its options")

    def begin(self, task: SchemeTask) -> None:
        """Get ready: draw what is to be drawn."""
        raise TypeError(f"training scheme '{type(self).__name__}' cannot begin")

    def step(self) -> None:
        """Do one iteration."""
        raise TypeError(f"training scheme '{type(self).__name__}' cannot step")

    def finished(self) -> str | None:
        """Return why the scheme has come to its end, in words, or None."""
        raise TypeError(f"training scheme '{type(self).__name__}' never ends")

    def errors(self) -> tuple[Tensor, Tensor | None]:
        """Return the best relative errors so far, (6,) on the training samples and on the held-out ones."""
        raise TypeError(f"training scheme '{type(self).__name__}' does not state its errors")

    def save(self) -> State:
        """Return named tensors and plain data from which `load` goes on as if nothing had happened."""
        raise TypeError(f"training scheme '{type(self).__name__}' cannot be saved")

    def load(self, tensors: dict[str, Tensor], plain: dict[str, Any]) -> None:
        """Take up what `save` returned; `begin` has been called before with the same task."""
        raise TypeError(f"training scheme '{type(self).__name__}' cannot be taken up again")

    def finish(self) -> DampingBank:
        """Return the task's bank with the best parameters found."""
        raise TypeError(f"training scheme '{type(self).__name__}' gives no answer")


def relative_errors(bank: DampingBank, samples: SampleSums, spread: Tensor) -> Tensor:
    """Return the weighted root-mean-square error of the bank divided by the spread, (6,) float64.

    Args:
        bank: of subnetworks.
        samples: on which it is judged.
        spread: of the targets, (6,), N and N m.
    """
    square, weight = samples.error_sums(bank)
    return (square / weight.clamp_min(1e-300)).sqrt() / spread


def whole(value: Any, what: str, *, least: int = 1) -> int:
    """Return `value` if it is a whole number of at least `least`.

    Args:
        value: what was given.
        what: name of the option, for the message.
        least: value that is allowed.

    Raises:
        ConfigError: it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ConfigError(f"scheme option '{what}' is {value!r}: give a whole number of at least {least}")
    return value


def positive(value: Any, what: str, *, zero: bool = False) -> float:
    """Return `value` if it is a positive finite number, or with `zero` also zero.

    Args:
        value: what was given.
        what: name of the option, for the message.
        zero: whether zero is allowed.

    Raises:
        ConfigError: it is not.
    """
    good = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if not good or value < 0 or (value == 0 and not zero):
        raise ConfigError(
            f"scheme option '{what}' is {value!r}: give a positive number{' or zero' if zero else ''}"
        )
    return float(value)
