"""The law of what is not modelled: variance and correlation time of a stochastic force, by marginal likelihood.

The likelihood of a law, `law_likelihood.Likelihood`, is made as large as it can be in the degrees of freedom in which a
variance of zero is rejected, one after the other left out. Hypotheses with other means are compared by this likelihood,
not by a restricted one, which would depend on the means.

References: Kristensen, Madsen and Joergensen (2004), Automatica 40(2) 225-237; Self and Liang (1987), JASA 82(398), for
the boundary.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from auvnn.diagnosis.noise_law.likelihood.law_likelihood import PROMISED, STEPS, Likelihood
from auvnn.metrics.force_law import ForceLaw

Array = NDArray[np.float64]
# A degree of freedom has a stochastic force where its likelihood ratio rejects a variance of zero at this level.
ALPHA_BOUNDARY = 0.01


@dataclass(frozen=True)
class Estimate:
    """A law, and what it makes of an explanation.

    Attributes:
        law: None where no variance is above zero.
        value: minus twice the log likelihood, priors of the parameters in it, up to what all laws of a log share.
        step: (P,) how the parameters move with the law.
        information: (P, P) of the parameters under the law, their priors left out.
        p_values: (6,) of there being no force, each degree of freedom in addition to the others.
        gain: what of `value` the step takes away, as far as the windows are linear.
    """

    law: ForceLaw | None
    value: float
    step: Array
    information: Array
    p_values: Array
    gain: float = 0.0


def estimate(
    likelihood: Likelihood,
    start: ForceLaw | None = None,
    only: Sequence[int] | None = None,
    most: int = STEPS,
    enough: float = PROMISED,
) -> Estimate:
    """Return the law that is most likely, without the degrees of freedom whose variance may be zero.

    Args:
        likelihood: of an explanation.
        start: a law from which to begin.
        only: degrees of freedom to look at, by default all that show; given, none of them is left out.
        most: steps of each search for the likeliest law; with none the law is that of the start.
        enough: what a step of such a search must promise of minus twice the log likelihood.
    """
    axes = likelihood.shown() if only is None else list(only)
    p_values = np.ones(6)
    while axes:
        begin = None
        if start is not None and all(start.rms[i] > 0 for i in axes):
            begin = np.log(np.concatenate([start.rms[axes], start.time[axes]]))
        x = begin if begin is not None and most == 0 else likelihood.best(axes, begin, most, enough)[1]
        count = len(axes)
        if only is not None:
            break
        plain = likelihood.of(likelihood.law(axes, np.exp(x[:count]), np.exp(x[count:])))[0]
        gains = []
        for k in range(count):
            rest = [j for j in range(count) if j != k]
            law = likelihood.law(
                [axes[j] for j in rest], np.exp(x[rest]), np.exp(x[[count + j for j in rest]])
            )
            gains.append(likelihood.of(law if rest else None)[0] - plain)
            p_values[axes[k]] = boundary_p_value(gains[-1])
        weakest = int(np.argmin(gains))
        if p_values[axes[weakest]] < ALPHA_BOUNDARY:
            break
        start = likelihood.law(axes, np.exp(x[:count]), np.exp(x[count:]))
        axes.pop(weakest)
    law = likelihood.law(axes, np.exp(x[:count]), np.exp(x[count:])) if axes else None
    value, step, information, gain = likelihood.of(law)
    return Estimate(law, value, step, information, p_values, gain)


def boundary_p_value(gain: float) -> float:
    """Return the p-value of a variance of zero by twice the gain of the log likelihood with a variance and a time.

    At the boundary the likelihood ratio is a mixture of chi-squares; a correlation time that has no meaning without a
    variance makes it larger. Half of a chi-square with two degrees of freedom bounds both from above.
    """
    return float(0.5 * chi2.sf(max(gain, 0.0), 2)) if gain > 0.0 else 1.0
