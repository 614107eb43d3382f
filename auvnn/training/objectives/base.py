"""What every training objective promises: subnetworks fitted one step ahead go in, better ones come out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.training.objectives import OBJECTIVES

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Refined:
    """How training on an objective went after the one-step fit.

    Attributes:
        model: with the subnetworks found; never worse on the left-out windows than what went in.
        train: error of the fitted windows by iteration, the first that of the one-step fit; empty where the
            objective is the one-step fit itself. In standard deviations of each channel's own error.
        held_out: the same of the windows left out, in the standard deviations of the one-step fit.
        stopped: in words.
        warnings: sentences about what went wrong on the way.
    """

    model: GreyBox
    train: tuple[float, ...] = ()
    held_out: tuple[float, ...] = ()
    stopped: str = ""
    warnings: tuple[str, ...] = field(default=())


class Objective:
    """What the error is that training makes small."""

    name: ClassVar[str]
    # Whether a one-step fit on accelerations that were estimated from velocities may be the better beginning.
    estimated_start: bool = False

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this objective, as plain data."""
        return {}

    def choose(self, starts: Sequence[GreyBox], stopping: Log) -> int:
        """Return which of several one-step fits to go on from."""
        return 0

    def refine(self, model: GreyBox, fitted: Log, stopping: Log, tell: Tell | None = None) -> Refined:
        """Go on from subnetworks that were fitted one step ahead.

        Args:
            model: holds the subnetworks; it is not changed.
            fitted: what to fit on.
            stopping: what decides when to stop and which weights to keep.
            tell: called with the state of the work, in words.

        Raises:
            InputError: the log has no window of the length that the objective needs.
        """
        raise TypeError(f"training objective '{type(self).__name__}' does not say how it refines")


def build_objective(description: str | Mapping[str, Any] | Objective) -> Objective:
    """Build an objective from its name or from `{objective: name, <options>}`.

    Raises:
        ConfigError: an unknown objective or option, or a value out of range.
    """
    return OBJECTIVES.build(description, Objective, "objective", "one_step")
