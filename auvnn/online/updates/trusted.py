"""What was learned before a slow fault began to show: to go back to when it does."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

# Two states are kept, the older one this far back at least, s: a velocity that contradicts the positions shows within
# the first, sensors that contradict one another within a second, and so well within the second.
SLOW, QUICK = 20.0, 2.0


class Trusted:
    """Keeps the weights of two moments, so that one of them lies before whatever takes a while to show.

    Args:
        weights: (6, P) those that the adapter begins with.
        scheme: what the scheme remembers then.
        every: s between the two states.
    """

    def __init__(self, weights: Tensor, scheme: Mapping[str, Tensor], every: float = SLOW) -> None:
        """Trust what is there."""
        self.every = every
        first = (None, weights.clone(), dict(scheme))
        self._kept: list[tuple[float | None, Tensor, dict[str, Tensor]]] = [first, first]

    def due(self, t: float) -> bool:
        """Whether the newest state is old enough to keep another one."""
        newest = self._kept[-1][0]
        return newest is None or t - newest >= self.every

    def keep(self, t: float, weights: Tensor, scheme: Mapping[str, Tensor]) -> None:
        """Keep a state beside the newest one; the oldest goes.

        Args:
            t: time of the state, s.
            weights: (6, P).
            scheme: what the scheme remembers.
        """
        self._kept = [self._kept[-1], (t, weights.clone(), dict(scheme))]

    def restart(self) -> None:
        """Another clock begins; what is trusted stays."""
        self._kept = [(None, weights, scheme) for _, weights, scheme in self._kept]

    def oldest(self) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the older state, and go on."""
        return self._kept[0][1:]

    def back(self) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the older state, and trust nothing younger."""
        _, weights, scheme = self._kept[0]
        self._kept = [(None, weights, scheme)] * 2
        return weights, scheme

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        found: dict[str, Tensor] = {}
        for k, (t, weights, scheme) in enumerate(self._kept):
            since = torch.tensor(float("nan") if t is None else t, dtype=torch.float64)
            found |= {f"{k}.since": since, f"{k}.weights": weights}
            found |= {f"{k}.scheme.{name}": value for name, value in scheme.items()}
        return found

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        kept: list[tuple[float | None, Tensor, dict[str, Tensor]]] = []
        for k in range(2):
            since, own = float(state[f"{k}.since"]), f"{k}.scheme."
            scheme = {name[len(own) :]: v.clone() for name, v in state.items() if name.startswith(own)}
            kept.append((None if since != since else since, state[f"{k}.weights"].clone(), scheme))
        self._kept = kept
