"""Model against measurements: one step ahead, running freely, and where the error sits.

`compare` scores a model, or several, on a log; `locate` divides the residual wrench by degree of freedom and operating
regime.
"""

from auvnn.comparison.compare import Comparison
from auvnn.comparison.several import Comparisons, compare

__all__ = ["Comparison", "Comparisons", "compare"]
