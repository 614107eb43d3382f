"""Weights on trial: what learns goes on learning, what is used moves when learning has shown that it helps."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import torch
from torch import Tensor

from auvnn.damping.bank import DampingBank
from auvnn.online.updates.weights import Weights


class Trial:
    """Keeps the weights in use apart from those that learn, degree of freedom by degree of freedom.

    Both predict every sample before anything is learned from it. With e the error of the learning weights, e0 that of
    the weights in use and R the variance of the noise, a degree of freedom's evidence is the log-likelihood ratio

        L <- max(0, L + (e0^2 - e^2) / 2R)

    and its learning weights come into use when L exceeds `proof`; L then starts again from zero (Page's cumulative
    sum). While the weights in use are right, exp(sum) is a martingale of mean one, so that noise alone brings the
    evidence to `proof` once in exp(proof) samples or more (Ville's inequality): learning under noise costs nothing
    until it has something to show.

    Args:
        weights: those that learn.
        proof: logarithm of the odds that are asked for; 0: what learns is used at once.

    Reference: Page (1954), Continuous inspection schemes, Biometrika 41; Dawid (1984), Present position and potential
    developments: the prequential approach, J. R. Statist. Soc. A 147.
    """

    def __init__(self, weights: Weights, proof: float) -> None:
        """Use the weights as they are."""
        self.proof = proof
        self._bank = Weights(copy.deepcopy(weights.bank), weights.layers)
        self.used = weights.read()
        self.evidence = torch.zeros(6, dtype=self.used.dtype)

    @property
    def on(self) -> bool:
        """Whether the weights in use are others than those that learn."""
        return self.proof > 0.0

    @property
    def bank(self) -> DampingBank:
        """The subnetworks in use."""
        return self._bank.bank

    def take(self, weights: Weights, target: Tensor, nu: Tensor, error: Tensor, variance: Tensor) -> int:
        """Take in a sample before it is learned from; return of how many degrees of freedom the weights moved.

        Args:
            weights: those that learn.
            target: (6,) what the subnetworks should give, in the output scale.
            nu: (6,) velocity.
            error: (6,) what the learning weights leave of it.
            variance: (6,) of the noise.
        """
        if not self.on:
            return 0
        old = target - self._bank.value(nu)
        self.evidence = (self.evidence + 0.5 * (old.square() - error.square()) / variance).clamp_min(0.0)
        proven = self.evidence > self.proof
        if bool(proven.any()):
            self.used = torch.where(proven[:, None], weights.read(), self.used)
            self._bank.write(self.used)
            self.evidence = torch.where(proven, 0.0, self.evidence)
        return int(proven.sum())

    def begin(self, weights: Weights) -> None:
        """Use the weights as they are now, and begin to judge again."""
        self.used, self.evidence = weights.read(), torch.zeros_like(self.evidence)
        self._bank.write(self.used)

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        return {"used": self.used, "evidence": self.evidence}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        self.used, self.evidence = state["used"].clone(), state["evidence"].clone()
        self._bank.write(self.used)
