"""One step ahead: the acceleration at every measured state, and nothing after that."""

from __future__ import annotations

from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.training.objectives.base import Objective, Refined, Tell


class OneStepObjective(Objective):
    """The fit that every training begins with is already the answer."""

    name = "one_step"

    def refine(self, model: GreyBox, fitted: Log, stopping: Log, tell: Tell | None = None) -> Refined:
        """Return the model as it is."""
        return Refined(model)
