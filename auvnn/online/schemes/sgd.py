"""Stochastic gradient descent on the current residual: the paper's online learning, every weight at every sample."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from auvnn.damping.base import true_or_false
from auvnn.online.schemes.base import Observation, OnlineScheme, number
from auvnn.online.updates.weights import Weights


class SGD(OnlineScheme):
    """One gradient step on half the squared residual of the sample just seen.

    w <- w + rate e J            plain, as in the paper
    w <- w + rate e J / (1e-3 + |J|^2)   normalised: `rate` is the share of the residual that is taken out

    Following every residual wins on the next sample and forgets what was learned elsewhere: the paper says so.

    Args:
        learning_rate: see above; the paper does not give one.
        normalised: divide by the squared length of the gradient, which keeps the step stable for any weights.

    Reference: van de Ven, Flanagan and Toal (2004), section 5.2; Haykin, Adaptive Filter Theory, chapter 6.
    """

    name = "sgd"

    def __init__(self, *, learning_rate: float = 0.1, normalised: bool = True) -> None:
        """Check the options."""
        self.learning_rate = number(learning_rate, "learning_rate", 0.0, 2.0)
        self.normalised = true_or_false(normalised, "online option 'normalised'")

    def options(self) -> dict[str, Any]:
        """Return the options that rebuild this scheme."""
        return {"learning_rate": self.learning_rate, "normalised": self.normalised}

    def propose(self, weights: Weights, observation: Observation) -> Tensor:
        """Return the weights after one step."""
        step = self.learning_rate * observation.error[:, None] * observation.slope
        if self.normalised:
            step = step / (1e-3 + observation.slope.square().sum(1, keepdim=True))
        return weights.read() + step
