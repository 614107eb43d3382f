"""Whether a stochastic force is left, and whether it is too large for a disturbance, or too small to matter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench
from auvnn.diagnosis.noise_law.hypothesis import SECOND
from auvnn.diagnosis.noise_law.likelihood.estimate_law import ALPHA_BOUNDARY
from auvnn.diagnosis.residuals.forces import actuators_of, share_of
from auvnn.diagnosis.residuals.unnamed_size import AXES
from auvnn.diagnosis.residuals.variance_component_test import Unnamed, variance_component_test, white
from auvnn.diagnosis.stages.state import Setting, State
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.windows import Windows

Array = NDArray[np.float64]

# A stochastic force beyond this share of the actuators' is no disturbance: the model lacks what moves the vehicle.
LARGEST = 0.5
# Standard errors of a one-sided limit that holds in 19 of 20 logs.
ONE_SIDED = 1.645
# Standard deviations of what commands between samples leave uncertain within which a force is no more than that.
COVERING = 2.0


def leaves_force(asked: Setting, state: State, end: FittedHypothesis) -> bool:
    """Whether a test says that an explanation leaves a stochastic force.

    Args:
        asked: what the sensors' noise is at least.
        state: windows.
        end: the explanation.
    """
    noise = white(end, asked.floor)
    return variance_component_test(end, state.windows, noise).p_value < ALPHA_BOUNDARY


def exceeds_actuators(asked: Setting, state: State, law: ForceLaw | None) -> bool:
    """Whether the stochastic force is so large beside the actuators' that no cause can be told from the motion.

    Args:
        asked: layout.
        state: windows over which the force was sought.
        law: root mean square, N and N m, and correlation time, s, of the force; None where none was found.
    """
    return bool(beyond_actuators(asked, state, law).any())


def beyond_actuators(asked: Setting, state: State, law: ForceLaw | None) -> NDArray[np.bool_]:
    """Return in which degrees of freedom the stochastic force is so large beside the actuators', (6,).

    Args:
        asked: layout.
        state: windows over which the force was sought.
        law: root mean square, N and N m, and correlation time, s, of the force; None where none was found.
    """
    if law is None:
        return np.zeros(6, dtype=bool)
    mean = law.mean_over(SECOND)
    drive = actuators_of(asked.layout.model, state.windows)
    # Fins and a vehicle's own balance hold what thrusters do not: the largest of forces, and of moments, is the measure.
    most = np.repeat([drive[:3].max(), drive[3:].max()], 3)
    return (most > 0.0) & (mean > LARGEST * most)


def negligible(asked: Setting, state: State, law: ForceLaw | None, uncertain: UncertainWrench) -> bool:
    """Whether a stochastic force is within the tolerance, by its upper limit as a share of the actuators' force.

    Its mean over a second counts: a force that changes from sample to sample moves a vehicle little. What the commands
    between samples leave uncertain is no lack of the model, however much it is.

    Args:
        asked: tolerance and layout.
        state: windows over which the force was sought.
        law: root mean square, N and N m, and correlation time, s, of the force; None where none was found.
        uncertain: what commands between samples leave uncertain.
    """
    if asked.tolerance.strict:
        return False
    if law is None:
        return True
    upper = upper_limit(law, state.windows)
    lasting = upper * law.mean_over(SECOND) / np.maximum(law.rms, 1e-300)
    beyond = np.where(upper > COVERING * uncertain.over(law.time), lasting, 0.0)
    share = share_of(beyond, actuators_of(asked.layout.model, state.windows))[beyond > 0.0]
    return bool(np.isfinite(share).all() and (share < asked.tolerance.force).all())


def upper_limit(law: ForceLaw, windows: Windows) -> Array:
    """Return the upper 95 % limits of a force's root mean square, (6,), N and N m.

    Args:
        law: of the force.
        windows: over which it was estimated.
    """
    times = windows.times[:, windows.warmup :]
    whole = float((times[:, -1] - times[:, 0]).sum())
    # Of a process of correlation time T, a span of 2 T is worth one independent value.
    independent = np.maximum(whole / (2.0 * np.maximum(law.time, 1e-9)), 1.0)
    return law.rms * (1.0 + ONE_SIDED / np.sqrt(2.0 * independent))


def sized_by_law(left: Unnamed | None, law: ForceLaw | None, windows: Windows) -> Unnamed | None:
    """Return what is left with the sizes that the law of the stochastic force has.

    A Fourier series in each window tells the size of a force roughly; the law has its likeliest size and correlation
    time. In a degree of freedom without a force in the law none is left. What would have shown stays as it was.

    Args:
        left: as the test of a force has it; None where it was not asked.
        law: root mean square, N and N m, and correlation time, s.
        windows: over which it was estimated.
    """
    if left is None or law is None:
        return left
    upper = upper_limit(law, windows)
    sizes = {}
    for axis, size in left.sizes.items():
        i = AXES.index(axis)
        sizes[axis] = (
            replace(
                size,
                rms=float(law.rms[i]),
                upper=float(upper[i]),
                correlation_time=float(law.time[i]),
            )
            if i in law.axes
            else replace(size, rms=0.0, correlation_time=None)
        )
    return replace(left, sizes=sizes)
