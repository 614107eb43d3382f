"""Forces that are known but for their size, as further parameters of what windows say of a force in cells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.noise_law.likelihood.sums import ForceSums

Array = NDArray[np.float64]


def with_known_forces(sums: ForceSums, axis: int, courses: Array, scale: Array) -> ForceSums:
    """Return what the windows say with the sizes of forces of known courses as further parameters, at zero.

    A force that is known in each cell is a combination of the cells' columns: nothing is linearised again.

    Args:
        sums: of the windows, with P parameters.
        axis: degree of freedom in which the forces act, 0 to 5.
        courses: (B, K, k) what k forces of size one are in each cell.
        scale: (k,) standard deviations of their sizes' priors, N or N m.
    """
    known, own, states = sums.known, sums.statistics, sums.states
    at = known + axis * sums.cells + np.arange(sums.cells)
    hessian = _with(_with(own.hessian, at, courses, known).swapaxes(1, 2), at, courses, known)
    slope = _with(own.slope[:, None], at, courses, known)[:, 0]
    if states is not None:
        # Before the parameters there are the errors, or the change of the last state with the initial one.
        across = _with(states.across, 1 + at, courses, 1 + known)
        states = replace(states, across=across, ends=_with(states.ends, 12 + at, courses, 12 + known))
    priors, count = sums.priors.extended_by(scale**-2.0), len(scale)
    return replace(
        sums,
        statistics=replace(own, hessian=hessian, slope=slope),
        known=known + count,
        theta=np.concatenate([sums.theta, np.zeros(count)]),
        mean=priors.mean,
        precision=priors.precision,
        joint=priors.joint,
        reach=np.concatenate([sums.reach, np.tile([[-np.inf], [np.inf]], count)], axis=1),
        states=states,
    )


def _with(columns: Array, at: NDArray[np.int64], courses: Array, place: int) -> Array:
    """Return columns (B, m, n) with those of forces of some courses put in at a place."""
    return np.concatenate([columns[..., :place], columns[..., at] @ courses, columns[..., place:]], axis=-1)
