"""Recursive least squares on the last layer, with noise, forgetting, and a wake-up when the vehicle has changed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from scipy import stats
from torch import Tensor

from auvnn.online.schemes.base import Observation, OnlineScheme, anchors, number
from auvnn.online.updates.weights import Weights

# Chance of a wake-up at a sample without cause, each degree of freedom.
FALSE_ALARM = 1e-8
# Wake-ups are judged over this many seconds, and follow one another no faster.
WATCH = 1.0
# Observations that say less than this of their own noise are not worth an update.
NEGLIGIBLE = 1e-5


class RLS(OnlineScheme):
    """A Kalman filter for the last layer of each subnetwork, six small ones at once.

    K = P J / (J'P J + R),  w <- w + K e,  P <- (1 - K J') P,  P^-1 <- l P^-1 + (1 - l) P0^-1

    The hidden layer is kept, so that what was learned offline gives the shape and the last layer how much of it.
    P0 says how wrong the subnetworks may be, in force: a common factor on the whole drag, the model's other drag
    included (`gain`), and any shape (`shape`, of the output's scale). Forgetting goes towards P0, so that nothing
    winds up without excitation. Innovations that no chance explains (a chi-square test over the last second) say
    that the vehicle has changed: P is then widened by `change_gain` and `change_shape`, and learning is as fast as
    noise allows.
    Damping vanishes at rest: this is known beforehand, as exactly as `rest` says, and is learned first.

    Args:
        forgetting: time constant of excited time, s.
        gain: relative uncertainty of the whole drag, in calm.
        shape: uncertainty of its shape, of the output's scale, in calm.
        change_gain: the same after a change; damping many times larger is what a payload can do.
        change_shape: the same after a change.
        rest: uncertainty of the damping's vanishing at rest, of the output's scale; 0 to know nothing of it.

    Reference: Ljung (1999), System Identification, section 11.2; Kulhavy and Zarrop (1993), Int. J. Control 58(4)
    for forgetting towards a prior.
    """

    name = "rls"
    layers = "last"

    def __init__(
        self,
        *,
        forgetting: float = 60.0,
        gain: float = 0.03,
        shape: float = 0.02,
        change_gain: float = 3.0,
        change_shape: float = 0.3,
        rest: float = 0.01,
    ) -> None:
        """Check the options."""
        self.forgetting = number(forgetting, "forgetting", 0.01, 1e9)
        self.gain = number(gain, "gain", 0.0, 100.0)
        self.shape = number(shape, "shape", 1e-6, 100.0)
        self.change_gain = number(change_gain, "change_gain", 0.0, 100.0)
        self.change_shape = number(change_shape, "change_shape", 1e-6, 100.0)
        self.rest = number(rest, "rest", 0.0, 100.0)
        self._threshold = 0.0
        self._calm = self._wide = self._covariance = self._information = torch.zeros(0)
        self._evidence = self._carried = self._age = self._still = torch.zeros(0)

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        names = ("forgetting", "gain", "shape", "change_gain", "change_shape", "rest")
        return {name: getattr(self, name) for name in names}

    def start(self, weights: Weights, known: Tensor | None = None) -> None:
        """Turn "how wrong in force" into covariances of the weights."""
        own = weights.read()
        values, slopes = weights.jacobians(anchors(weights))
        gram = torch.einsum("nap,naq->apq", slopes, slopes) / len(slopes)
        eye = torch.eye(weights.width, dtype=own.dtype)
        size = gram.diagonal(dim1=-2, dim2=-1).mean(-1).clamp_min(1e-12)[:, None, None]
        free = torch.linalg.inv(gram + 1e-3 * size * eye)
        # The weights that would give once more the whole drag, or what of it they can.
        whole = values if known is None else values + known
        carried = torch.einsum("nap,na->ap", slopes, whole) / len(slopes)
        factor = torch.einsum("apq,aq->ap", free, carried)
        common = factor[:, :, None] * factor[:, None, :]
        # What does not exist (padding) must not move, however wide the rest is.
        there = weights.used.to(own.dtype)
        mask, absent = there[:, :, None] * there[:, None, :], torch.diag_embed(1.0 - there)
        self._calm = (self.gain**2 * common + self.shape**2 * free) * mask + 1e-12 * absent
        self._wide = (self.change_gain**2 * common + self.change_shape**2 * free) * mask
        self._still = torch.zeros_like(own)
        self._information = torch.linalg.inv(self._calm)
        self._covariance = self._calm.clone()
        if self.rest > 0.0:
            self._still = weights.jacobian(torch.zeros(6, dtype=own.dtype))[1]
            self._wide = self._towards_rest(self._wide)[1]
            known = self._still[:, :, None] * self._still[:, None, :] / self.rest**2
            self._information = self._information + known
        self._threshold = float(stats.chi2.isf(FALSE_ALARM, weights.width))
        self._watch()

    def _towards_rest(self, covariance: Tensor) -> tuple[Tensor, Tensor]:
        """Return the gain (6, P) towards no damping at rest, and the covariance after that is known."""
        towards = torch.einsum("apq,aq->ap", covariance, self._still)
        gain = towards / ((towards * self._still).sum(-1) + max(self.rest, 1e-6) ** 2)[:, None]
        return gain, covariance - gain[:, :, None] * towards[:, None, :]

    def _watch(self) -> None:
        self._evidence = torch.zeros_like(self._covariance[..., 0])
        self._carried = torch.zeros_like(self._covariance)
        self._age = torch.zeros(6, dtype=self._covariance.dtype)

    def changed(self) -> None:
        """Widen everything: the guards have seen a change."""
        self._covariance = self._covariance + self._wide
        self._watch()

    def propose(self, weights: Weights, observation: Observation) -> Tensor | None:
        """Return the weights after one update of the filter."""
        slope, error = observation.slope, observation.error
        self._wake(observation)
        towards = torch.einsum("apq,aq->ap", self._covariance, slope)
        known = (towards * slope).sum(-1)
        if bool((known < NEGLIGIBLE * observation.variance).all()):
            return None
        gain = towards / (known + observation.variance)[:, None]
        covariance = self._covariance - gain[:, :, None] * towards[:, None, :]
        kept = float(torch.exp(torch.tensor(-observation.dt / self.forgetting)))
        covariance = torch.linalg.inv(kept * torch.linalg.inv(covariance) + (1.0 - kept) * self._information)
        self._covariance = 0.5 * (covariance + covariance.mT)
        found = weights.read() + gain * error[:, None]
        if self.rest > 0.0:
            # The last layer's output at rest is linear in it, for every form that has any.
            gain, self._covariance = self._towards_rest(self._covariance)
            found = found - gain * (self._still * found).sum(-1, keepdim=True)
        return found

    def _wake(self, observation: Observation) -> None:
        """Widen the axes whose innovations of the last second no chance explains."""
        spread = (observation.slope * torch.einsum("apq,aq->ap", self._covariance, observation.slope)).sum(-1)
        weight = 1.0 / (spread + observation.variance)
        kept = float(torch.exp(torch.tensor(-observation.dt / WATCH)))
        self._evidence = kept * self._evidence + (weight * observation.error)[:, None] * observation.slope
        outer = observation.slope[:, :, None] * observation.slope[:, None, :]
        self._carried = kept * self._carried + weight[:, None, None] * outer
        self._age = self._age + observation.dt
        size = self._carried.diagonal(dim1=-2, dim2=-1).mean(-1).clamp_min(1e-12)[:, None, None]
        ridge = 1e-6 * size * torch.eye(self._carried.shape[-1], dtype=self._carried.dtype)
        solved = torch.linalg.solve(self._carried + ridge, self._evidence)
        informative = (solved * self._evidence).sum(-1) > self._threshold
        late = self._age > 0.2 * WATCH
        woken = informative & late
        if bool(woken.any()):
            self._covariance = self._covariance + woken[:, None, None] * self._wide
            calm = (~woken).to(self._evidence.dtype)
            self._evidence = self._evidence * calm[:, None]
            self._carried = self._carried * calm[:, None, None]
            self._age = self._age * calm

    def state(self) -> dict[str, Tensor]:
        """Return covariance and watch; the priors come again from the weights that the adapter began with."""
        return {
            "calm": self._calm,
            "wide": self._wide,
            "information": self._information,
            "covariance": self._covariance,
            "evidence": self._evidence,
            "carried": self._carried,
            "age": self._age,
            "still": self._still,
        }

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        for name in self.state():
            setattr(self, f"_{name}", state[name].clone())
