"""How the commands of a vehicle's logs go from one sample to the next, as a model states it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from auvnn.errors import ModelError

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox

NAMES = ("linear", "ahead", "smooth", "averaged")
"""Other than held: a straight line, a change before the sample, a cubic through four samples, a mean of several."""
ALIKE = 1.2
"""Factor by which the interval between a log's samples may differ from that which the path was found for."""
MOST = 64
"""Samples in a mean."""


@dataclass(frozen=True)
class CommandPath:
    """How commands go between samples, by a log of such a vehicle.

    What moves the vehicle over an interval is the mean of the command on its path. It depends on how often commands are
    logged, so that it counts for logs with about the same interval alone; in others commands are held.

    Attributes:
        between_samples: "linear", "ahead", "smooth" or "averaged".
        share_of_next: of the next sample's command in an interval's mean, 0 to 1.
        interval: between samples, s.
        samples: in the mean of "averaged", an even number; else zero.
        interpolated: what lines and cubics go through: "command", or "thrust".
    """

    between_samples: str
    share_of_next: float
    interval: float
    samples: int = 0
    interpolated: str = "command"

    @classmethod
    def read(cls, given: Any, where: str) -> CommandPath:
        """Return what a model file says.

        Args:
            given: its entry.
            where: the file, for messages.

        Raises:
            ModelError: it says none of what is possible.
        """
        known = {"between_samples", "share_of_next", "interval", "samples", "interpolated"}
        if (
            not isinstance(given, Mapping)
            or not {"between_samples", "share_of_next", "interval"} <= set(given) <= known
        ):
            raise ModelError(
                f"{where}: commands needs 'between_samples', 'share_of_next' and 'interval', and may have 'samples' and "
                "'interpolated'"
            )
        name, through = given["between_samples"], given.get("interpolated", "command")
        if name not in NAMES:
            raise ModelError(
                f"{where}: commands.between_samples is {name!r}: choose {', '.join(NAMES)}, or leave commands out"
            )
        if through not in ("command", "thrust"):
            raise ModelError(f"{where}: commands.interpolated is {through!r}: choose command or thrust")
        share, interval = (given[k] for k in ("share_of_next", "interval"))
        for label, value, low, high in (
            ("share_of_next", share, 0.0, 1.0),
            ("interval", interval, 1e-6, 1e6),
        ):
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not number or not low <= value <= high:
                raise ModelError(
                    f"{where}: commands.{label} is {value!r}: a number from {low:g} to {high:g} is needed"
                )
        samples = given.get("samples", 0)
        counted = isinstance(samples, int) and not isinstance(samples, bool)
        averaged = name == "averaged"
        if (
            not counted
            or (averaged and not (2 <= samples <= MOST and samples % 2 == 0))
            or (not averaged and samples)
        ):
            raise ModelError(
                f"{where}: commands.samples is {samples!r}: an even number from 2 to {MOST} for averaged, else left out"
            )
        return cls(name, float(share), float(interval), samples, through)

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of a model file."""
        data: dict[str, Any] = {
            "between_samples": self.between_samples,
            "share_of_next": self.share_of_next,
            "interval": self.interval,
        }
        if self.samples:
            data["samples"] = self.samples
        if self.interpolated != "command":
            data["interpolated"] = self.interpolated
        return data

    def counts_at(self, interval: float) -> bool:
        """Return whether it counts for a log with such an interval between samples, s."""
        return interval > 0.0 and abs(math.log(interval / self.interval)) <= math.log(ALIKE)

    def words(self) -> str:
        """Return the sentence for people."""
        share = self.share_of_next
        what, along = "thrust", f"as {1 - share:.0%} of its own sample's and {share:.0%} of the next one's"
        if self.between_samples == "smooth":
            through = "the thrusts of four samples" if self.interpolated == "thrust" else "four samples"
            along = f"along the cubic through {through}, {share - 0.5:+.2f} of an interval from its own"
        elif self.between_samples == "averaged":
            what = "command"
            along = f"as the average of {self.samples} samples about it, because commands have noise"
        return f"Commands change between the log's samples: the mean {what} of an interval was taken {along}."


def carried_over(made: GreyBox, other: GreyBox) -> GreyBox:
    """Return a model made from another one, with what that says beside its numbers and parts.

    Args:
        made: of the same vehicle, perhaps with other effects.
        other: what it was made from.
    """
    made.joint = None if other.joint is None else other.joint.of(made.effect_names)
    made.commands = other.commands
    return made


def with_commands(model: GreyBox, path: CommandPath | None) -> GreyBox:
    """Return the model with another statement of how commands go between samples; its parts are shared.

    Args:
        model: any.
        path: None for commands that are held.
    """
    made = model.sharing(model.members)
    made.commands = path
    return made
