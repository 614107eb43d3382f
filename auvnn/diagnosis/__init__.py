"""Where a model fails, which effect is missing, and how much better it gets with it."""

from auvnn.checks.actuators import ActuatorCheck, check_actuators
from auvnn.comparison.compare import Comparison, compare
from auvnn.diagnosis.answers.answer import Diagnosis
from auvnn.diagnosis.diagnose import diagnose
from auvnn.diagnosis.full_data.large_logs import diagnose_files
from auvnn.diagnosis.one_step.rank import Ranked, rank_one_step
from auvnn.improvement.add import Improvement, add
from auvnn.improvement.fleet import Fleet, fleet

__all__ = [
    "ActuatorCheck",
    "Comparison",
    "Diagnosis",
    "Fleet",
    "Improvement",
    "Ranked",
    "add",
    "check_actuators",
    "compare",
    "diagnose",
    "diagnose_files",
    "fleet",
    "rank_one_step",
]
