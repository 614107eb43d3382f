"""What the objectives of free running share: which one-step fit they go on from, and the windows that can be followed."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.training.objectives.base import Objective, Refined, Tell
from auvnn.training.objectives.starting import best_start, sound_shots, start_option
from auvnn.training.objectives.windows import Shots
from auvnn.training.schemes.base import positive, whole


class FreeRunning(Objective):
    """An error of free runs over short windows, made small from the one-step fit on.

    Attributes:
        window: length of the windows, s.
        patience: steps without a better error on the windows left out, after which it stops.
        start: "best" or "given"; see `start_option`.
    """

    option_names: tuple[str, ...] = ("window", "patience", "start")

    def __init__(self, window: float, patience: int, start: str) -> None:
        """Check the options.

        Args:
            window: length of the windows, s.
            patience: steps without a better error on the windows left out, after which it stops.
            start: "best" or "given".
        """
        self.window = positive(window, "window")
        self.patience = whole(patience, "patience")
        self.start = start_option(start)
        self.estimated_start = self.start == "best"

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this objective."""
        return {n: getattr(self, n) for n in self.option_names}

    def choose(self, starts: Sequence[GreyBox], stopping: Log) -> int:
        """Return which of several one-step fits to go on from."""
        return best_start(starts, stopping, self.window)

    def refine(self, model: GreyBox, fitted: Log, stopping: Log, tell: Tell | None = None) -> Refined:
        """Go on from the one-step fit; see the class."""
        model = copy.deepcopy(model)
        found = sound_shots(model, fitted, stopping, self.window)
        if isinstance(found, Refined):
            return found
        shots, judge, warnings = found
        return self.descend(model, shots, judge, warnings, tell or (lambda words: None))

    def descend(self, model: GreyBox, shots: Shots, judge: Shots, warnings: list[str], tell: Tell) -> Refined:
        """Make the error small.

        Args:
            model: holds the subnetworks; it is changed.
            shots: windows that are fitted.
            judge: windows that are left out.
            warnings: what went wrong so far.
            tell: called with the state of the work, in words.
        """
        raise TypeError(f"training objective '{type(self).__name__}' does not say how it descends")
