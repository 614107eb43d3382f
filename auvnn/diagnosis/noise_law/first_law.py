"""The law of the force at the fit with which a search beside it begins, and the cells in which that force is constant."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.likelihood.about_motion import linear_about_its_own
from auvnn.diagnosis.noise_law.likelihood.estimate_law import Estimate, estimate
from auvnn.diagnosis.noise_law.likelihood.law_likelihood import Likelihood
from auvnn.diagnosis.noise_law.likelihood.sums import CELL, force_sums, whole_cells
from auvnn.metrics.force_law import ForceLaw, cell_for
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]
# How often the windows are made linear about the motion first.
TURNS = 3


@dataclass(frozen=True)
class FirstLaw:
    """The fit with which a search begins, and the law of the force there.

    Attributes:
        explanation: the fit, linear about its own motion.
        law: of the force that it leaves.
        cell: the time over which the force is constant, s.
    """

    explanation: FittedHypothesis
    law: ForceLaw
    cell: float


def first_law(
    first: FittedHypothesis, windows: Windows, sigma: Array, response: Array, cell: float | None = None
) -> FirstLaw | None:
    """Return the law of the force that a fit leaves; None where no variance is above zero.

    Args:
        first: the fit.
        windows: of the log, without a law.
        sigma: (18,) the sensors' white noise.
        response: (6, 6) accelerations by the forces of the law.
        cell: the time over which the force is constant, s; by default as short as its correlation time needs.
    """
    # A whole number of cells: a window's last force is that with which the next one begins.
    length = whole_cells(windows, CELL) if cell is None else cell

    def estimated(law: ForceLaw | None = None, axes: list[int] | None = None) -> Estimate:
        about = replace(windows, law=None, around=first.around)
        return estimate(Likelihood(force_sums(first, about, sigma, length, response)), law, axes)

    found = estimated()
    if found.law is None:
        return None
    shorter = whole_cells(windows, cell_for(found.law.time[found.law.axes]))
    if shorter < length and cell is None:
        length = shorter
        found = estimated(replace(found.law, cell=length), found.law.axes)
    for _ in range(TURNS):
        assert found.law is not None
        about = linear_about_its_own(first, windows, found, sigma)
        if about is None:
            break
        first = about
        found = estimated(found.law)
        if found.law is None:
            return None
    assert found.law is not None
    return FirstLaw(first, found.law, length)
