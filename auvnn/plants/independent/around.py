"""The water where the vehicles are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Around:
    """The water where the vehicles are.

    Attributes:
        flow: velocity through it, body axes, as all but the drag feel it, (R, 3).
        dragged: the same, as the drag feels it.
        gain: rate of its own velocity as the turning body sees it, (R, 3), or None where it is still.
        walls: of each boundary, share of the added mass and its slope with depth, (R, 1) each.
        grown: factor on the added mass, (R, 1).
    """

    flow: Array
    dragged: Array
    gain: Array | None
    walls: list[tuple[Array, Array]]
    grown: Array
