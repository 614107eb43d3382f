"""Model against measurements: one step ahead, running freely, and where the error sits.

`compare` scores a model on a log; `locate` divides the residual wrench by degree of freedom and operating regime.
"""

from auvnn.comparison.compare import Comparison, compare

__all__ = ["Comparison", "compare"]
