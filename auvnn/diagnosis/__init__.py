"""Where a model fails, which effect is missing, and how much better it gets with it."""

from auvnn.diagnosis.answer import Diagnosis
from auvnn.diagnosis.compare import Comparison, compare
from auvnn.diagnosis.diagnose import diagnose
from auvnn.diagnosis.improve import Improvement, add

__all__ = ["Comparison", "Diagnosis", "Improvement", "add", "compare", "diagnose"]
