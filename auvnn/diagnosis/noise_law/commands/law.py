"""A law of the commands: how they go from one sample to the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import LAWS, between
from auvnn.metrics.windows import Windows
from auvnn.models.actuation.command_path import CommandPath


@dataclass(frozen=True)
class Holding:
    """How commands go from sample to sample, by a log.

    Attributes:
        name: "held", "linear", "ahead", "smooth" or "averaged".
        share: of the next sample's command in an interval's mean.
        odds: logarithm of the odds against holding; zero where it is held.
        gain: fall of the weighted squared error, for the variance that the windows show.
        samples: in an interval's mean, where it is averaged; else zero.
        curves: of the thrusters, whose mean thrust is taken; None for a commanded wrench.
        stated: whether the model states it, and no other one is clearly likelier.
    """

    name: str
    share: float
    odds: float
    gain: float
    samples: int = 0
    curves: MeanThrust | None = field(default=None, compare=False)
    stated: bool = False

    @property
    def changes(self) -> bool:
        """Whether commands change between samples."""
        return self.name != "held"

    def applied(self, windows: Windows) -> Windows:
        """Return windows of commands that go so."""
        along = self.name if self.name in LAWS else "ahead"
        return between(windows, self.share, along, samples=self.samples, curves=self.curves)

    def path(self, interval: float) -> CommandPath | None:
        """Return it as models state it; None where commands are held.

        Args:
            interval: between samples of the log, s.
        """
        if self.name == "held":
            return None
        through = "thrust" if self.curves is not None and self.curves.through_thrusts else "command"
        return CommandPath(self.name, self.share, interval, self.samples, through)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        told = {"between_samples": self.name, "share_of_next": self.share, "log_odds": self.odds}
        if self.curves is not None and self.curves.through_thrusts:
            told["interpolated"] = "thrust"
        if self.stated:
            told["stated"] = True
        return {**told, "samples": self.samples} if self.samples else told


HELD = Holding("held", 0.0, 0.0, 0.0)
