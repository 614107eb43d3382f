"""What drives a vehicle over a stretch of time: commands and whatever else the log knows, held per interval."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import torch
from torch import Tensor


@dataclass(frozen=True)
class Inputs:
    """Inputs of a stretch of T rows, each held until the next row's time; (..., T, size), SI.

    Attributes:
        command: thruster commands in [-1, 1], or the commanded wrench, N and N m, (..., T, n).
        fins: fin angles, rad, (..., T, m), or None for fins held at zero.
        voltage: V, (..., T), or None.
        altitude: height above the bottom, m, (..., T), or None.
        within: commands over P equal parts of each row's interval, (..., T, P, n), where they change between samples and
            that is known; None where they are held. The command of a row then is that with the mean thrust, which solvers
            with steps of their own take.
        fins_within: fin angles over the same parts, rad, (..., T, P, m); None where they are held.
    """

    command: Tensor
    fins: Tensor | None = None
    voltage: Tensor | None = None
    altitude: Tensor | None = None
    within: Tensor | None = None
    fins_within: Tensor | None = None

    def rows(self, first: int, last: int | None = None) -> Inputs:
        """Return rows `first` to `last` (excluded)."""
        part = slice(first, last)
        return Inputs(
            self.command[..., part, :],
            None if self.fins is None else self.fins[..., part, :],
            None if self.voltage is None else self.voltage[..., part],
            None if self.altitude is None else self.altitude[..., part],
            None if self.within is None else self.within[..., part, :, :],
            None if self.fins_within is None else self.fins_within[..., part, :, :],
        )

    def mapped(self, work: Callable[[Tensor], Tensor]) -> Inputs:
        """Return what some work makes of each input that there is.

        Args:
            work: from (..., T, size) to what takes its place.
        """
        there = {f.name: getattr(self, f.name) for f in fields(self)}
        return Inputs(**{name: None if x is None else work(x) for name, x in there.items()})  # type: ignore[arg-type]

    def by_steps(self, substeps: int) -> Inputs:
        """Return these without what goes by parts of an interval, where a part is no whole number of steps.

        Args:
            substeps: equal steps per interval.
        """
        parts = [x.shape[-2] for x in (self.within, self.fins_within) if x is not None]
        if all(substeps % size == 0 for size in parts):
            return self
        return replace(self, within=None, fins_within=None)

    def fins_move(self, steered: bool) -> bool:
        """Return whether the fins' angles change within an interval, and so come beside the thrust.

        Args:
            steered: whether an effect has the fins follow their commands.
        """
        return self.fins is not None and (steered or self.fins_within is not None)

    @property
    def given(self) -> tuple[bool, ...]:
        """Which of fins, voltage and altitude there are."""
        return tuple(x is not None for x in (self.fins, self.voltage, self.altitude))

    def each(self) -> list[Inputs]:
        """Return the rows one by one, without their time axis; views, so that a loop need not index."""
        count = self.command.shape[-2]
        nothing = (None,) * count
        fins = nothing if self.fins is None else self.fins.unbind(-2)
        voltage = nothing if self.voltage is None else self.voltage.unbind(-1)
        altitude = nothing if self.altitude is None else self.altitude.unbind(-1)
        return [Inputs(*row) for row in zip(self.command.unbind(-2), fins, voltage, altitude, strict=True)]


def joined(parts: Sequence[Inputs]) -> Inputs:
    """Return stretches one after the other: their rows (T, size), or windows (B, T, size).

    Args:
        parts: stretches of which the same is given.
    """

    def cat(name: str) -> Tensor | None:
        there = [getattr(p, name) for p in parts]
        return torch.cat([x for x in there if x is not None]) if any(x is not None for x in there) else None

    return Inputs(**{f.name: cat(f.name) for f in fields(Inputs)})  # type: ignore[arg-type]
