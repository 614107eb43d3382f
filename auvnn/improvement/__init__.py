"""The whole loop in one call: a better model and an error budget, whatever the log."""

from auvnn.improvement.answer import Improved, Step
from auvnn.improvement.loop import improve

__all__ = ["Improved", "Step", "improve"]
