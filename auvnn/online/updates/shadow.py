"""Shadow evaluation: weights that were updated are judged on the next samples against those last validated."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import torch
from torch import Tensor

from auvnn.online.updates.weights import Weights

# Standard errors by which the updated weights must be worse before they are taken back.
SURE = 3.0
FEWEST = 8


class Shadow:
    """Keeps the last validated weights and compares the current ones with them, sample by sample.

    A sample's verdict is (e^2 - e0^2) / (e^2 + e0^2 + R) averaged over the degrees of freedom, from -1 to 1, e the
    error of the current weights before they learn from the sample and e0 that of the validated ones: no single
    sample can decide.

    Args:
        weights: the current ones.
        judge: s over which they are judged.
        worse: mean verdict beyond which they are taken back.
    """

    def __init__(self, weights: Weights, judge: float, worse: float) -> None:
        """Take the current weights as valid."""
        self.judge, self.worse = judge, worse
        self._bank = Weights(copy.deepcopy(weights.bank), weights.layers)
        self.valid = weights.read()
        self.scheme_state: dict[str, Tensor] = {}
        self._sums = torch.zeros(3, dtype=torch.float64)  # samples, verdicts, squared verdicts
        self.since: float | None = None

    def error(self, target: Tensor, nu: Tensor) -> Tensor:
        """Return what the validated weights leave of a target (6,)."""
        return target - self._bank.value(nu)

    def verdict(self, t: float, error: Tensor, old: Tensor, variance: Tensor) -> str | None:
        """Take in a sample; return "worse", "valid", or None while it is open."""
        if self.since is None:
            return None
        if self.since == -float("inf"):
            self.since = t
        new, before = error.square(), old.square()
        score = float(((new - before) / (new + before + variance)).mean())
        self._sums = self._sums + torch.tensor([1.0, score, score * score], dtype=torch.float64)
        count, total, squares = self._sums.tolist()
        if count < FEWEST:
            return None
        mean = total / count
        spread = max(squares / count - mean * mean, 0.0) ** 0.5 / count**0.5
        if mean > self.worse and mean > SURE * spread:
            return "worse"
        return "valid" if t - self.since >= self.judge else None

    def open(self, t: float) -> None:
        """Begin to judge at the first update after a validation."""
        if self.since is None:
            self.since = t

    def close(self, weights: Tensor | None = None, scheme_state: Mapping[str, Tensor] | None = None) -> None:
        """End the judgement; with `weights` they are the validated ones from now on."""
        self.since = None
        self._sums = torch.zeros_like(self._sums)
        if weights is not None:
            self.valid = weights.clone()
            self._bank.write(weights)
        if scheme_state is not None:
            self.scheme_state = dict(scheme_state)

    def restart(self) -> None:
        """Judge from the next sample on, by a clock that may have started again."""
        self.since = -float("inf")
        self._sums = torch.zeros_like(self._sums)

    def state(self) -> dict[str, Tensor]:
        """Return the tensors that are remembered."""
        since = torch.tensor(float("nan") if self.since is None else self.since, dtype=torch.float64)
        own = {"valid": self.valid, "sums": self._sums, "since": since}
        return {**own, **{f"scheme.{k}": v for k, v in self.scheme_state.items()}}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        self._sums = state["sums"].clone()
        since = float(state["since"])
        self.since = None if since != since else since
        self.valid = state["valid"].clone()
        self._bank.write(self.valid)
        prefix = "scheme."
        self.scheme_state = {k[len(prefix) :]: v for k, v in state.items() if k.startswith(prefix)}
