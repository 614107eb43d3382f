"""What training on rollouts begins with: windows that the one-step fit can follow at all."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from auvnn.errors import ConfigError
from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.training.objectives.base import Refined
from auvnn.training.objectives.windows import Shots, training_windows

# There is nothing to train on where more than this share of the windows diverges.
MANY = 0.5


def sound_shots(
    model: GreyBox, fitted: Log, stopping: Log, window: float
) -> tuple[Shots, Shots, list[str]] | Refined:
    """Return windows to fit and windows to judge by, without those that diverge from the start, and warnings.

    Where there is nothing to learn, or the runs of most windows diverge, the answer is the model as it is.

    Args:
        model: with its subnetworks.
        fitted: log that is fitted.
        stopping: log that decides when to stop.
        window: length of the windows, s.

    Raises:
        InputError: a log has too few windows.
    """
    if model.damping is None or not list(model.damping.parameters()):
        return Refined(model, stopped="there is nothing to learn")
    warnings: list[str] = []
    found = []
    for log in (fitted, stopping):
        shots = Shots(model, training_windows(model, log, window))
        good = shots.usable(model)
        lost, count = int((~good).sum()), len(good)
        if lost > MANY * count:
            words = (
                f"{lost} of {count} windows of free running diverge with the one-step fit, so there is nothing "
                "to train on: the one-step fit is the answer; try damping=dissipative"
            )
            return Refined(model, stopped="the rollouts of the one-step fit diverge", warnings=(words,))
        if lost:
            warnings.append(f"{lost} of {count} windows diverge with the one-step fit and were left out")
            shots.keep(good)
        found.append(shots)
    return found[0], found[1], warnings


def best_start(starts: Sequence[GreyBox], log: Log, window: float) -> int:
    """Return which model follows the windows of a log best, initial states fitted; 0 where none does.

    Args:
        starts: models.
        log: that they are to follow.
        window: length of the windows, s.
    """
    errors = []
    for model in starts:
        shots = Shots(model, training_windows(model, log, window))
        seen = shots.windows.mask.sum((0, 1)).numpy() > 0
        sigma = np.where(seen, shots.size, np.inf)
        errors.append(min(shots.judge(model, sigma) for _ in range(2)))
    return int(np.argmin(errors))


def start_option(value: Any) -> str:
    """Return the option `start` if it is one of the two words.

    Raises:
        ConfigError: it is not.
    """
    if value not in ("best", "given"):
        raise ConfigError(f"objective.start={value!r}: best or given is needed")
    return str(value)
