"""Where a model fails, which effect is missing, and how much better it gets with it."""

from auvnn.diagnosis.actuators import ActuatorCheck, check_actuators
from auvnn.diagnosis.answer import Diagnosis
from auvnn.diagnosis.compare import Comparison, compare
from auvnn.diagnosis.diagnose import diagnose
from auvnn.diagnosis.fleet import Fleet, fleet
from auvnn.diagnosis.improve import Improvement, add
from auvnn.diagnosis.many import diagnose_files
from auvnn.diagnosis.rank_one_step import Ranked, rank_one_step

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
