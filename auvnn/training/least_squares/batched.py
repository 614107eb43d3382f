"""Levenberg-Marquardt over many small independent problems at once, several starting points for each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from auvnn.training.least_squares.networks import Normal, Problems

RUNNING, CONVERGED, GOAL, STUCK, OUTPACED, OVERFITTING, LIMIT = range(7)
REASONS = {
    CONVERGED: "converged: the error no longer falls",
    GOAL: "goal reached",
    STUCK: "no step lowers the error",
    OUTPACED: "another start was ahead",
    OVERFITTING: "the error on the held-out runs no longer falls",
    LIMIT: "iteration limit reached",
}


@dataclass(frozen=True)
class Rules:
    """When to step how far and when to stop; see the scheme's options."""

    restarts: int
    halve_every: int
    max_iterations: int
    tolerance: float
    window: int
    patience: int
    damping: float
    goal: float | None


class LeastSquares:
    """State and step of the iteration, for `members * restarts` problems.

    Each problem minimises its own weighted mean square residual. The step solves the normal equations of
    inner and outer parameters, with damping mu D on the inner ones alone; the outer ones are then solved for
    exactly (Kaufman's form of variable projection). D is the geometric mean of Marquardt's diag(J^T J) and
    Levenberg's identity (scaled by the mean of that diagonal): Marquardt's alone lets hidden units that
    hardly matter yet take huge steps and saturate, and ends in poorer optima. mu follows how well the last
    step was predicted (Nielsen's rule). A step that does not lower the cost, or gives no finite one, is taken
    back; problems that have ended leave the batch.

    Args:
        problems: what is fitted.
        held_out: the same problems on the held-out samples, or None.
        spread: (members,) standard deviation of the targets, in which `goal` is meant.
        rules: see `Rules`.
        start: (members, Q) inner parameters that replace the first draw, or None.
        generator: draws the starting points.

    References:
        Marquardt 1963; Kaufman, A variable projection method for solving separable nonlinear least squares
        problems, BIT 15 (1975); Nielsen, Damping parameter in Marquardt's method (1999).
    """

    def __init__(
        self,
        problems: Problems,
        held_out: Problems | None,
        spread: Tensor,
        rules: Rules,
        start: Tensor | None,
        generator: torch.Generator,
    ) -> None:
        """Draw the starting points and evaluate them."""
        self.problems, self.held_out, self.rules = problems, held_out, rules
        draws = [problems.draw(generator) for _ in range(rules.restarts)]
        if start is not None:
            draws[0] = start
        self.iteration = 0
        self.member = torch.arange(problems.members).repeat(rules.restarts)
        self._goal_cost = ((rules.goal or 0.0) * spread).square()[self.member]
        self._exact_cost = (1e-13 * spread).square()[self.member]
        theta = torch.cat(draws)
        beta, cost = problems.solve_outer(theta, self.member)
        cost = torch.nan_to_num(cost, nan=torch.inf)
        count = len(theta)
        held = self._held(theta, beta, self.member)
        self.state: dict[str, Tensor] = {
            "theta": theta,
            "beta": beta,
            "cost": cost,
            "mu": theta.new_full((count,), rules.damping),
            "status": torch.zeros(count, dtype=torch.int64),
            "best_theta": theta.clone(),
            "best_beta": beta.clone(),
            "best_cost": cost.clone(),
            "best_score": cost.clone() if held is None else held,
            "since_best": torch.zeros(count, dtype=torch.int64),
            "recent": cost[:, None].repeat(1, rules.window),
        }
        normal = problems.normal(theta, beta, self.member)
        self.state.update(zip(_NORMAL, normal.tensors(), strict=True))
        self._end(torch.arange(count))

    def _held(self, theta: Tensor, beta: Tensor, member: Tensor) -> Tensor | None:
        if self.held_out is None:
            return None
        return torch.nan_to_num(self.held_out.cost(theta, beta, member), nan=torch.inf)

    @property
    def running(self) -> bool:
        """Whether a problem is still in the batch."""
        return bool((self.state["status"] == RUNNING).any())

    def step(self) -> None:
        """Try one step in every problem that is still in the batch."""
        s = self.state
        rows = (s["status"] == RUNNING).nonzero()[:, 0]
        if not len(rows):
            return
        self.iteration += 1
        member = self.member[rows]
        step, predicted, solved = self._solve(rows)
        theta = s["theta"][rows] + step
        beta, cost = self.problems.solve_outer(theta, member)
        good = solved & (cost < s["cost"][rows]) & torch.isfinite(cost)
        ratio = (s["cost"][rows] - cost) * self.problems.total[member] / predicted.clamp_min(1e-300)
        factor = torch.where(good, (1.0 - (2.0 * ratio - 1.0) ** 3).clamp(1.0 / 3.0, 2.0), 2.0)
        s["mu"][rows] = (s["mu"][rows] * factor).clamp_min(1e-15)
        if bool(good.any()):
            taken = rows[good]
            s["theta"][taken], s["beta"][taken], s["cost"][taken] = theta[good], beta[good], cost[good]
            normal = self.problems.normal(theta[good], beta[good], member[good])
            for name, tensor in zip(_NORMAL, normal.tensors(), strict=True):
                s[name][taken] = tensor
            self._remember(taken)
        s["recent"][rows, self.iteration % self.rules.window] = s["cost"][rows]
        self._end(rows)

    def _solve(self, rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return the step (B, Q), the fall of the squared error it should bring, and if it is usable."""
        inner, cross, outer, slope, outer_slope = (self.state[name][rows] for name in _NORMAL)
        diagonal = torch.diagonal(inner, dim1=1, dim2=2)
        mean = diagonal.mean(1, keepdim=True).clamp_min(1e-300)
        damping = self.state["mu"][rows, None] * (diagonal.clamp_min(1e-12 * mean) * mean).sqrt()
        if cross.shape[2]:
            own = torch.diagonal(outer, dim1=1, dim2=2)
            factor, _ = torch.linalg.cholesky_ex(outer + torch.diag_embed(1e-10 * own.clamp_min(1e-300)))
            solved = torch.cholesky_solve(torch.cat([cross.mT, outer_slope[..., None]], 2), factor)
            inner = inner - cross @ solved[..., :-1]
            slope = slope - (cross @ solved[..., -1:])[..., 0]
        factor, info = torch.linalg.cholesky_ex(inner + torch.diag_embed(damping))
        step = -torch.cholesky_solve(slope[..., None], factor)[..., 0]
        good = (info == 0) & torch.isfinite(step).all(1)
        step = torch.where(good[:, None], step, 0.0)
        curvature = (inner @ step[..., None])[..., 0]
        return step, -(step * (2.0 * slope + curvature)).sum(1), good

    def _remember(self, rows: Tensor) -> None:
        """Keep the best parameters so far: by the held-out runs where there are some."""
        s = self.state
        held = self._held(s["theta"][rows], s["beta"][rows], self.member[rows])
        score = s["cost"][rows] if held is None else held
        better = score < s["best_score"][rows]
        s["since_best"][rows] = torch.where(better, 0, s["since_best"][rows] + 1)
        rows, score = rows[better], score[better]
        s["best_score"][rows] = score
        for name in ("theta", "beta", "cost"):
            s[f"best_{name}"][rows] = s[name][rows]

    def _end(self, rows: Tensor) -> None:
        """Take those problems out of the batch that have come to an end."""
        s, rules = self.state, self.rules
        cost, status = s["cost"][rows], s["status"][rows]
        oldest = s["recent"][rows, (self.iteration + 1) % rules.window]
        settled = (self.iteration >= rules.window) & (cost > oldest * (1.0 - rules.tolerance))
        settled |= cost <= self._exact_cost[rows]
        ends = [(CONVERGED, settled), (STUCK, s["mu"][rows] > 1e10)]
        if rules.goal is not None:
            ends.insert(0, (GOAL, cost <= self._goal_cost[rows]))
        if self.held_out is not None:
            ends.append((OVERFITTING, s["since_best"][rows] >= rules.patience))
        for reason, ended in ends:
            status = torch.where((status == RUNNING) & ended, reason, status)
        s["status"][rows] = status
        if rules.goal is not None:  # one start that gets there ends the other starts of its problem
            reached = torch.isin(self.member, self.member[s["status"] == GOAL])
            s["status"][reached & (s["status"] == RUNNING)] = OUTPACED
        if rules.restarts > 1 and self.iteration and self.iteration % rules.halve_every == 0:
            self._race()
        if self.iteration >= rules.max_iterations:
            s["status"][s["status"] == RUNNING] = LIMIT

    def _race(self) -> None:
        """Drop the worse half of the starts that are left for each problem, but never the leading one."""
        s = self.state
        rank = self.iteration // self.rules.halve_every
        allowed = max(1, self.rules.restarts >> rank)
        order = s["best_score"].view(self.rules.restarts, -1).argsort(dim=0, stable=True)
        place = order.argsort(dim=0, stable=True).flatten()
        s["status"][(place >= allowed) & (s["status"] == RUNNING)] = OUTPACED

    def best(self) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return the best start of each problem: inner and outer parameters, training cost and score."""
        s = self.state
        rows = s["best_score"].view(self.rules.restarts, -1).argmin(0) * self.problems.members
        rows = rows + torch.arange(self.problems.members)
        return s["best_theta"][rows], s["best_beta"][rows], s["best_cost"][rows], s["best_score"][rows]

    def reasons(self) -> list[int]:
        """Return why the winning start of each problem ended, as a key of `REASONS`."""
        s = self.state
        winners = s["best_score"].view(self.rules.restarts, -1).argmin(0) * self.problems.members
        return s["status"][winners + torch.arange(self.problems.members)].tolist()

    def save(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return everything that the next step depends on."""
        return dict(self.state), {"iteration": self.iteration}

    def load(self, tensors: dict[str, Tensor], plain: dict[str, Any]) -> None:
        """Take up what `save` returned."""
        # A fresh allocation: alignment may decide how a product is summed, and with it the last bit.
        self.state = {name: tensor.clone() for name, tensor in tensors.items()}
        self.iteration = int(plain["iteration"])


_NORMAL = tuple(f"normal_{name}" for name in Normal.__dataclass_fields__)
