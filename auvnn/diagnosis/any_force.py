"""A force of no known cause: is there one, and in which degree of freedom does it act?

Effects that have a name are tested one by one; what has none may hide from all of them. Here nothing is assumed of a
force but that it is smooth: in every window and degree of freedom it is a Fourier series of its own, and the score test
for the variance of its coefficients asks whether they are all nought. No measured input is asked to explain it.
Reference: Verbeke and Molenberghs (2003), Biometrics 59(2) 254-262 (score tests of variances); Satterthwaite (1946),
Biometrics Bulletin 2(6) 110-114 (the approximate distribution of a sum of weighted squares).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import chi2
from torch import Tensor

from auvnn.diagnosis.explain import Explanation
from auvnn.diagnosis.input_forces import AXES
from auvnn.effects import Body, Effect, Moment, Parameter
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.training.prediction_error import answers, reduce

Array = NDArray[np.float64]
HARMONICS = 3
# Standard deviations of chance above which a further degree of freedom is told.
CLEAR = 3.0


class AnyForce(Effect):
    """tau_i <- tau_i + sum_k theta_ik f_k(t), f = 1 and sines and cosines of whole multiples of 2 pi t / period.

    A probe of the diagnosis and of nothing else: its coefficients differ from window to window.
    """

    name = "any_force"
    cause = "a force of no known cause"
    symbol = "tau_t"
    reference = "Verbeke and Molenberghs (2003)"

    def __init__(self, model: GreyBox, period: float) -> None:
        """Make the probe for windows of a length, s."""
        vehicle = model.vehicle
        force = 0.02 * float(vehicle.mass) * float(vehicle.gravity)
        sizes = [force] * 3 + [0.1 * force * float(vehicle.length)] * 3
        count = 2 * HARMONICS + 1
        super().__init__(
            tuple(
                Parameter(f"{a}_{k}", "N" if i < 3 else "N m", 0.0, sizes[i], -1e9, 1e9)
                for i, a in enumerate(AXES)
                for k in range(count)
            )
        )
        self.keep("rates", 2.0 * np.pi / period * np.arange(1, HARMONICS + 1))

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the series."""
        lead = moment.nu.shape[:-1]
        turned = moment.time.to(moment.nu).unsqueeze(-1) * self.kept("rates").to(moment.nu)
        one = torch.ones_like(turned[..., :1])
        functions = torch.cat([one, torch.sin(turned), torch.cos(turned)], dim=-1)
        functions = functions.expand(*lead, functions.shape[-1])
        return functions @ self.theta.to(functions).unflatten(0, (6, -1)).mT


@dataclass(frozen=True)
class Unnamed:
    """What any force could still explain.

    Attributes:
        z: (6,) how far the errors go with a force in each degree of freedom, in standard deviations of chance.
        p_values: (6,) of each.
        energy: (6,) the same above chance, in units that are the same before and after an effect is added.
    """

    z: Array
    p_values: Array
    energy: Array

    @property
    def p_value(self) -> float:
        """The smallest, corrected for there being six."""
        return float(min(1.0, 6.0 * self.p_values.min()))

    @property
    def axis(self) -> str:
        """The degree of freedom in which it shows most."""
        return AXES[int(self.z.argmax())]

    @property
    def shares(self) -> dict[str, float]:
        """How much each degree of freedom has of what is beyond chance, the largest first; they sum to one.

        A force in one degree of freedom shows in those that it moves as well.
        """
        above = np.where(self.z > CLEAR, self.z, 0.0)
        above[self.z.argmax()] = max(float(self.z.max()), 1e-12)
        return {AXES[i]: float(above[i] / above.sum()) for i in np.argsort(-above) if above[i] > 0.0}

    def left_of(self, before: Unnamed) -> float:
        """Return how much of what was above chance before still is, 0 to 1."""
        whole = float(np.maximum(before.energy, 0.0).sum())
        return float(np.clip(np.maximum(self.energy, 0.0).sum() / whole, 0.0, 1.0)) if whole > 0.0 else 1.0


def any_force(explanation: Explanation, windows: Windows, sigma: Array | None = None) -> Unnamed:
    """Ask whether the errors that an explanation leaves look like those of a force.

    Args:
        explanation: the fit.
        windows: those it was fitted to.
        sigma: (18,) weights' standard deviations; by default the white part of the errors that are left, so that a
            slow part does not count as noise.
    """
    fitted = explanation.fitted
    model = fitted.model
    times = windows.times[:, windows.warmup :]
    probe = AnyForce(model, float((times[:, -1] - times[:, 0]).max()))
    asked = GreyBox(model.vehicle, [*model.copied_effects(), probe], model.damping, model.actuation)
    if sigma is None:
        sigma = white(explanation)
    names = [*explanation.names, str(probe.name)]
    sums, _, _ = reduce(windows, answers(asked, windows, fitted.initial, names), sigma)
    known = len(fitted.theta)
    # What is known takes its share first: the fit weighed the channels otherwise.
    prior = fitted.priors.precision
    inside = fitted.priors.inside(fitted.theta)
    pull = sums.slope[:, :known].sum(0) - prior * (fitted.theta - fitted.priors.mean)
    step = np.zeros(known)
    square = sums.total[:known, :known] + np.diag(prior)
    step[inside] = np.linalg.lstsq(square[np.ix_(inside, inside)], pull[inside], rcond=1e-12)[0]
    slope = sums.slope[:, known:] - sums.hessian[:, known:, :known] @ step
    count = 2 * HARMONICS + 1
    z, p_values, energy = np.zeros(6), np.ones(6), np.zeros(6)
    for axis in range(6):
        own = np.arange(count) + axis * count
        hessian = sums.hessian[:, known + own[:, None], known + own]
        expected = float(np.trace(hessian, axis1=1, axis2=2).sum())
        variance = 2.0 * float((hessian**2).sum())
        if not variance > 0.0:
            continue
        found = float((slope[:, own] ** 2).sum())
        z[axis] = (found - expected) / np.sqrt(variance)
        scale, degrees = variance / (2.0 * expected), 2.0 * expected**2 / variance
        p_values[axis] = float(chi2.sf(found / scale, degrees))
        energy[axis] = (found - expected) / scale
    return Unnamed(z, p_values, energy)


def white(explanation: Explanation) -> Array:
    """Return the white part of what is left, (18,), infinite for channels that do not count."""
    fitted = explanation.fitted
    noise = fitted.statistics.noise()
    known = np.isfinite(fitted.sigma) & np.isfinite(noise)
    return np.where(known, np.minimum(np.where(known, noise, np.inf), fitted.sigma), np.inf)
