"""The set that the weights may not leave, and how fast the damping may change."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor

from auvnn.models import GreyBox, Inputs
from auvnn.models.equations_of_motion import DRAG_TERMS
from auvnn.online.guards import Guards
from auvnn.online.updates.weights import Weights

VISITED = 32
# New velocities are remembered when they lie this far from those that are, in the velocity scale.
APART = 0.2
HALVINGS = 6


class Bounds:
    """Shortens a proposed step until its end is admissible.

    Admissible are weights (a) within `bound` row sizes of where they began, (b) whose damping, at the velocities
    visited, stays below `output_bound` force scales, and (c) with which the whole drag takes no energy less
    than before where it took none (nu . d >= 0 at the velocities visited); (d) at the present velocity the
    damping moves by no more than `rate` dt. (a) is a projection; for (b), (c) and (d) the step is shortened.

    Args:
        weights: the adapted ones.
        guards: the numbers.
    """

    def __init__(self, weights: Weights, guards: Guards) -> None:
        """Keep where the weights began."""
        self.guards = guards
        self.start = weights.read()
        size = self.start.square().sum(1, keepdim=True) / weights.used.sum(1, keepdim=True).clamp_min(1)
        self.reach = guards.bound * (1.0 + size.sqrt())
        self.visited = torch.zeros(0, 6, dtype=self.start.dtype)
        self.known = torch.zeros(0, dtype=self.start.dtype)
        self._next = 0

    def visit(self, model: GreyBox, nu: Tensor) -> None:
        """Remember a velocity (6,) if it is a new one; the oldest gives way."""
        assert model.damping is not None
        scaled = (self.visited - nu) / model.damping.input_scale
        if len(scaled) and float(scaled.square().sum(1).min()) < APART**2:
            return
        known = (nu * known_drag(model, nu)).sum()[None]
        if len(self.visited) < VISITED:
            self.visited, self.known = torch.cat([self.visited, nu[None]]), torch.cat([self.known, known])
            return
        self.visited, self.known = self.visited.clone(), self.known.clone()
        self.visited[self._next], self.known[self._next] = nu, known[0]
        self._next = (self._next + 1) % VISITED

    def admit(self, weights: Weights, proposed: Tensor, nu: Tensor, dt: float) -> tuple[Tensor | None, bool]:
        """Set the proposed weights as far as they are admissible.

        Returns:
            The change of the scaled damping at `nu` (6,), or None where no step was taken; and whether the step
            was shortened.
        """
        before = weights.read()
        if not bool(torch.isfinite(proposed).all()):
            return None, True
        wanted = torch.minimum(torch.maximum(proposed, self.start - self.reach), self.start + self.reach)
        shortened = bool((wanted != proposed).any())
        rows = torch.cat([self.visited, nu[None]])
        old = weights.value(rows)
        most = torch.clamp(old.abs().amax(-1), min=self.guards.output_bound)
        least = self._power(weights, old).clamp(max=0.0)
        least = least - 1e-9 * (1.0 + least.abs())
        step, share, limit = wanted - before, 1.0, self.guards.rate * dt
        for _ in range(HALVINGS):
            weights.write(before + share * step if share < 1.0 else wanted)
            new = weights.value(rows)
            moved = float((new[-1] - old[-1]).abs().max())
            if moved > limit:
                share, shortened = share * max(0.99 * limit / moved, 0.1), True
            elif bool((new.abs().amax(-1) > most).any()) or (
                self.guards.dissipative and bool((self._power(weights, new) < least).any())
            ):
                share, shortened = 0.5 * share, True
            else:
                return new[-1] - old[-1], shortened
        weights.write(before)
        return None, True

    def _power(self, weights: Weights, scaled: Tensor) -> Tensor:
        """Return the power that all drag takes at the velocities visited (V,), W."""
        return self.known + (self.visited * scaled[:-1] * weights.bank.output_scale).sum(-1)

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        return {
            "start": self.start,
            "visited": self.visited,
            "known": self.known,
            "next": torch.tensor(self._next),
        }

    def load(self, state: Mapping[str, Tensor], weights: Weights) -> None:
        """Take up a state."""
        self.start = state["start"].clone()
        size = self.start.square().sum(1, keepdim=True) / weights.used.sum(1, keepdim=True).clamp_min(1)
        self.reach = self.guards.bound * (1.0 + size.sqrt())
        self.visited, self.known = state["visited"].clone(), state["known"].clone()
        self._next = int(state["next"])


def known_drag(model: GreyBox, nu: Tensor) -> Tensor:
    """Return the drag outside the subnetworks (..., 6), N and N m, positive against the motion, in still water."""
    lead = nu.shape[:-1]
    command, position = nu.new_zeros(*lead, model.actuators.size), nu.new_zeros(*lead, 3)
    rotation, time = torch.eye(3, dtype=nu.dtype).expand(*lead, 3, 3), nu.new_zeros(lead)
    with torch.no_grad():
        terms = model.wrenches(position, rotation, nu, model.actuators.static(command), Inputs(command), time)
    known = [terms[n] for n in DRAG_TERMS if n in terms and n != "damping subnetworks"]
    return -torch.stack(known).sum(0) if known else torch.zeros_like(nu)
