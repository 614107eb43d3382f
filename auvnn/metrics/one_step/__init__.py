"""One step ahead: what accelerations a model expects at the measured states, compared with those that were measured.

`replay` asks the model, `comparison` puts model and measurements through the same filter, again and again as parameters
move, and `residuals` says what is left.
"""

from auvnn.metrics.one_step.comparison import LogComparison, RunComparison
from auvnn.metrics.one_step.replay import OneStepReplay
from auvnn.metrics.one_step.residuals import OneStep, accelerations, inertia_of, one_step, scores

__all__ = [
    "LogComparison",
    "OneStep",
    "OneStepReplay",
    "RunComparison",
    "accelerations",
    "inertia_of",
    "one_step",
    "scores",
]
