"""What every damping form promises: a law from velocity to the force that opposes it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from auvnn.errors import ConfigError

AXES = ("X", "Y", "Z", "K", "M", "N")


class DampingForm(nn.Module):
    """One law d_i(nu) for one or several degrees of freedom, all evaluated at once.

    d_i stands on the left-hand side of the equation of motion, M nu_dot + ... + d(nu) = tau, so a force that
    brakes has the sign of the velocity. Inside a `DampingBank` the form sees the velocity divided by the
    bank's input scale and its answer is multiplied by the bank's output scale; alone it works in SI units.

    Every parameter and buffer of a form has the degrees of freedom as its first dimension. This is what lets
    a bank join forms of one kind into a single batched operation, and a training scheme treat the degrees of
    freedom as independent small problems.

    Args:
        axes: indices 0 to 5 of the degrees of freedom (X, Y, Z, K, M, N) that the form answers for.
    """

    name: ClassVar[str]

    def __init__(self, axes: Sequence[int]) -> None:
        """Keep the axes, which must be distinct and among 0 to 5."""
        super().__init__()
        self.axes = tuple(int(axis) for axis in axes)
        if not self.axes or len(set(self.axes)) != len(self.axes) or not set(self.axes) <= set(range(6)):
            raise ConfigError(
                f"axes of damping form '{self.name}' are {list(axes)}: give distinct numbers 0 to 5"
            )

    def forward(self, nu: Tensor) -> Tensor:
        """Return the damping of the form's axes.

        Args:
            nu: velocity (..., 6).

        Returns:
            Force and moment (..., n), n = len(axes), in the order of `axes`.
        """
        raise TypeError(f"damping form '{type(self).__name__}' does not say its law: write its forward()")

    def options(self) -> dict[str, Any]:
        """Return the keyword options that rebuild this form, as plain data."""
        return {}

    def reset(self, generator: torch.Generator) -> None:
        """Draw fresh initial parameters; nothing to draw unless a form says so."""

    def describe(self) -> dict[str, Any]:
        """Return the form's name and options as plain data, for `model.yaml`."""
        return {"form": self.name, **self.options()}

    @classmethod
    def joined(cls, forms: Sequence[DampingForm]) -> DampingForm:
        """Return one form that does the work of several of this kind with equal options."""
        first = forms[0]
        axes = [axis for form in forms for axis in form.axes]
        whole = cls(axes, **first.options())
        states = [form.state_dict() for form in forms]
        tensors = {key: torch.cat([state[key] for state in states]) for key in states[0]}
        example = next(iter(tensors.values()), None)
        if example is not None:
            whole.to(dtype=example.dtype, device=example.device)
        whole.load_state_dict(tensors)
        return whole


def positive_int(value: Any, what: str, *, most: int = 1000) -> int:
    """Return `value` if it is a whole number from 1 to `most`.

    Args:
        value: what was given.
        what: its name, for the message.
        most: largest value that is allowed.

    Raises:
        ConfigError: it is not.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise ConfigError(f"{what} is {value!r}: give a whole number from 1 to {most}")
    return value


def true_or_false(value: Any, what: str) -> bool:
    """Return `value` if it is a bool.

    Raises:
        ConfigError: it is not.
    """
    if not isinstance(value, bool):
        raise ConfigError(f"{what} is {value!r}: give true or false")
    return value


def redraw(generator: torch.Generator, *weights: tuple[Tensor, int]) -> None:
    """Draw weights in place, evenly from +-1/sqrt(inputs of the unit), which stands beside each."""
    with torch.no_grad():
        for tensor, inputs in weights:
            tensor.copy_(draw(tensor.shape, 1.0 / math.sqrt(inputs), generator, tensor))


def draw(shape: Sequence[int], bound: float, generator: torch.Generator, like: Tensor) -> Tensor:
    """Return numbers drawn evenly from [-bound, bound], the same on every device and in every dtype.

    Args:
        shape: of the numbers.
        bound: largest size of a number.
        generator: on the CPU; it decides all draws.
        like: gives dtype and device.
    """
    numbers = torch.rand(tuple(shape), generator=generator, dtype=torch.float64) * 2.0 - 1.0
    return (bound * numbers).to(dtype=like.dtype, device=like.device)
