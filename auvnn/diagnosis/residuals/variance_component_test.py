"""A force of no known cause: is there one, and in which degree of freedom does it act?

Effects that have a name are tested one by one; what has none may hide from all of them. Here nothing is assumed of a
force but that it is smooth: in every window and degree of freedom it is a Fourier series of its own, and the score test
for the variance of its coefficients asks whether they are all zero. No measured input is asked to explain it.
Reference: Verbeke and Molenberghs (2003), Biometrics 59(2) 254-262 (score tests of variances); Satterthwaite (1946),
Biometrics Bulletin 2(6) 110-114 (the approximate distribution of a sum of weighted squares).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import chi2
from torch import Tensor

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.residuals.input_forces import AXES
from auvnn.diagnosis.residuals.unnamed_size import Size, sizes, taken_out
from auvnn.effects import Body, Effect, Moment, Parameter
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox

Array = NDArray[np.float64]
HARMONICS = 3
# Variances of the coefficients that are tried, in plausible sizes squared, and log odds from which a further degree of
# freedom is reported.
VARIANCES = np.logspace(-10.0, 2.0, 49)
LEAST_ODDS = float(np.log(100.0))
# Sums beyond this are of free running that has grown without bound: what is left of their differences is rounding.
LARGEST = 1e60


class VarianceComponents(Effect):
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
        acts_in: degrees of freedom with the logarithm of the odds that a force acts there, beside those before it.
        sizes: degree of freedom to how large the force in it is; see `unnamed_size`.
    """

    z: Array
    p_values: Array
    energy: Array
    acts_in: dict[str, float]
    sizes: dict[str, Size] = field(default_factory=dict)

    @property
    def p_value(self) -> float:
        """The smallest, corrected for there being six."""
        return float(min(1.0, 6.0 * self.p_values.min()))

    @property
    def shares(self) -> dict[str, float]:
        """How much each degree of freedom has of the evidence for a force, the largest first; they sum to one."""
        whole = sum(self.acts_in.values())
        return {axis: odds / whole for axis, odds in self.acts_in.items()}

    def left_of(self, before: Unnamed) -> float:
        """Return how much of what was above chance before still is, 0 to 1."""
        whole = float(np.maximum(before.energy, 0.0).sum())
        return float(np.clip(np.maximum(self.energy, 0.0).sum() / whole, 0.0, 1.0)) if whole > 0.0 else 1.0


def variance_component_test(explanation: FittedHypothesis, windows: Windows, sigma: Array) -> Unnamed:
    """Ask whether the errors that an explanation leaves look like those of a force.

    Args:
        explanation: the fit.
        windows: those it was fitted to.
        sigma: (18,) standard deviations of the noise, infinite for channels that do not count; see `white`.

    Raises:
        numpy.linalg.LinAlgError: free running with the fit grows without bound.
    """
    fitted = explanation.fitted
    model = fitted.model
    times = windows.times[:, windows.warmup :]
    probe = VarianceComponents(model, float((times[:, -1] - times[:, 0]).max()))
    asked = model.extended_by(probe)
    names = [*explanation.names, str(probe.name)]
    sums, _, _ = normal_equations(windows, linearise(asked, windows, fitted.initial, names), sigma)
    sums = sums.finite()
    if not max(np.abs(sums.slope).max(initial=0.0), np.abs(sums.hessian).max(initial=0.0)) < LARGEST:
        raise np.linalg.LinAlgError("free running grows without bound")
    known = len(fitted.theta)
    # What is known takes its share first: the fit weighed the channels otherwise.
    inside = fitted.priors.inside(fitted.theta)
    pull = sums.slope[:, :known].sum(0) - fitted.priors.pull(fitted.theta)
    step = np.zeros(known)
    square = sums.total[:known, :known] + fitted.priors.square
    step[inside] = np.linalg.lstsq(square[np.ix_(inside, inside)], pull[inside], rcond=1e-12)[0]
    slope = sums.slope[:, known:] - sums.hessian[:, known:, :known] @ step
    count = 2 * HARMONICS + 1
    found = []
    for axis in range(6):
        own = np.arange(count) + axis * count
        found.append(moment_matched_test(slope[:, own], sums.hessian[:, known + own[:, None], known + own]))
    z, p_values, energy = (np.array(x) for x in zip(*found, strict=True))
    scale = np.array([p.scale for p in probe.parameters_of])
    slope, hessian = slope * scale, sums.hessian[:, known:, known:] * np.outer(scale, scale)
    acts_in = acting(slope, hessian)
    period = float((times[:, -1] - times[:, 0]).max())
    found_sizes = sizes(slope, hessian, list(acts_in), scale.reshape(6, -1)[:, 0], period)
    return Unnamed(z, p_values, energy, acts_in, found_sizes)


def acting(slope: Array, hessian: Array) -> dict[str, float]:
    """Return in which degrees of freedom a force acts, by evidence: the one that explains most, then the next beside it.

    A force in one degree of freedom shows in those that it moves as well; beside the first these have nothing left to
    explain. The coefficients are independent normal ones of a variance that fits best, tried on a grid; the evidence is
    the marginal likelihood's, which counts how much could have been explained by chance.

    Args:
        slope: (W, 6 K), J^T e of each window, in units of the coefficients' plausible sizes.
        hessian: (W, 6 K, 6 K), J^T J.
    """
    count = slope.shape[1] // 6
    blocks = {axis: np.arange(count) + i * count for i, axis in enumerate(AXES)}
    found: dict[str, float] = {}
    while blocks:
        best = {axis: _evidence(slope[:, own], hessian[:, own[:, None], own]) for axis, own in blocks.items()}
        axis = max(best, key=lambda name: best[name][0])
        odds, variance = best[axis]
        if odds < LEAST_ODDS and found:
            break
        found[axis] = max(odds, 1e-12)
        own = blocks.pop(axis)
        # What the force found explains is taken away from all, with what it could have explained.
        inner = hessian[:, own[:, None], own] + np.eye(count) / variance
        slope, hessian = taken_out(slope, hessian, own, inner)
        if odds < LEAST_ODDS:
            break
    return found


def _evidence(slope: Array, hessian: Array) -> tuple[float, float]:
    """Return the largest log marginal likelihood over that without a force, and the variance that has it."""
    values, vectors = np.linalg.eigh(hessian)
    values = np.maximum(values, 0.0)
    along = np.einsum("wij,wi->wj", vectors, slope)[..., None] ** 2
    spread = VARIANCES * values[..., None]
    gain = 0.5 * (along * VARIANCES / (1.0 + spread) - np.log1p(spread)).sum((0, 1))
    return float(gain.max()), float(VARIANCES[gain.argmax()])


def moment_matched_test(slope: Array, hessian: Array) -> tuple[float, float, float]:
    """Weigh slopes whose covariances by chance are known: distance from chance, p-value, and what is above chance.

    sum_w |g_w|^2 has by chance the mean sum tr H_w and the variance 2 sum tr H_w^2, and nearly the distribution of a
    scaled chi-square with these.

    Args:
        slope: (W, K), J^T e of each window in standard deviations of the noise.
        hessian: (W, K, K), J^T J of each window.
    """
    expected = float(np.trace(hessian, axis1=1, axis2=2).sum())
    variance = 2.0 * float((hessian**2).sum())
    if not variance > 0.0:
        return 0.0, 1.0, 0.0
    above = float((slope**2).sum()) - expected
    scale, degrees = variance / (2.0 * expected), 2.0 * expected**2 / variance
    p_value = float(chi2.sf((above + expected) / scale, degrees))
    return above / np.sqrt(variance), p_value, above / scale


def white(explanation: FittedHypothesis, floor: Array) -> Array:
    """Return the white part of what is left, (18,), infinite for channels that do not count.

    A slow part is not noise; and no channel is trusted beyond the floor, below which solvers err too.

    Args:
        explanation: the fit.
        floor: (18,).
    """
    fitted = explanation.fitted
    noise = fitted.statistics.noise()
    known = np.isfinite(fitted.sigma) & np.isfinite(noise)
    noise = np.maximum(np.where(known, noise, 0.0), floor)
    return np.where(known, np.minimum(noise, np.maximum(fitted.sigma, floor)), np.inf)
