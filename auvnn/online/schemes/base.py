"""What every online scheme promises: one observation in, a proposal for the weights out, and a state of tensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import torch
from torch import Tensor

from auvnn.errors import ConfigError
from auvnn.online.schemes import ONLINE_SCHEMES
from auvnn.online.updates.weights import Weights


@dataclass(frozen=True)
class Observation:
    """One sample as the schemes see it; forces in units of the bank's output scale.

    Attributes:
        t: s.
        dt: s since the last sample.
        nu: (6,) velocity through the water, SI.
        target: (6,) what the subnetworks should give.
        error: (6,) target minus what they give.
        slope: (6, P) of what they give by the weights.
        variance: (6,) of the target's noise.
    """

    t: float
    dt: float
    nu: Tensor
    target: Tensor
    error: Tensor
    slope: Tensor
    variance: Tensor


class OnlineScheme:
    """Moves the weights by one observation at a time, in bounded time and memory.

    A scheme only proposes: guards may shorten, refuse or take back its step. All that it remembers is in
    `state()`, so that a restored scheme goes on bit for bit.
    """

    name: ClassVar[str]
    layers: ClassVar[str] = "all"

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        return {}

    def start(self, weights: Weights, known: Tensor | None = None) -> None:
        """Begin with a bank's weights; `known` is the model's other drag at `anchors`, in the output scale."""

    def propose(self, weights: Weights, observation: Observation) -> Tensor | None:
        """Return the weights (6, P) that the observation asks for, or None where it has nothing new to say."""
        raise TypeError(f"{type(self).__name__} does not say how it learns: write its propose()")

    def accept(self, weights: Tensor) -> None:
        """Take note of the weights that were set in the end."""

    def changed(self) -> None:
        """Take note that the vehicle has changed: what was learned before may be wrong."""

    def state(self) -> dict[str, Tensor]:
        """Return all that the scheme remembers."""
        return {}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state that `state` returned."""


def build_online_scheme(description: str | Mapping[str, Any] | OnlineScheme) -> OnlineScheme:
    """Build a scheme from its name or from `{scheme: name, <options>}`.

    Raises:
        ConfigError: an unknown scheme or option, or a value out of range.
    """
    return ONLINE_SCHEMES.build(description, OnlineScheme, "scheme", "rls")


def number(value: Any, name: str, low: float, high: float) -> float:
    """Return an option as a number from `low` to `high`.

    Args:
        value: what was given.
        name: of the option, for the message.
        low: least value that is allowed.
        high: largest value that is allowed.

    Raises:
        ConfigError: it is none, or lies outside.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ConfigError(f"online option '{name}' is {value!r}: give a number from {low:g} to {high:g}")
    return float(value)


def anchors(weights: Weights, count: int = 64) -> Tensor:
    """Return velocities (count, 6) spread like those that the subnetworks were scaled for; always the same."""
    generator = torch.Generator().manual_seed(0)
    drawn = torch.randn(count, 6, generator=generator, dtype=torch.float64)
    return drawn * weights.bank.input_scale
