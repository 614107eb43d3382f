"""Six networks on 3000 samples of the manoeuvre: seconds until the worst of the six errs by one per mille."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import torch
from scipy.optimize import least_squares
from standard import NETWORKS, Work, samples

from auvnn.damping.bank import DampingBank
from auvnn.training.fit_damping import fit_damping
from auvnn.training.problem import DampingProblem

GOAL, HIDDEN, BUDGET = 1e-3, 5, 20.0
"""Relative error that counts as there; hidden units; processor seconds after which a peer is given up."""


SLOWEST, SLOWEST_SEEDS = "torch L-BFGS, joint", 3
"""What takes so long that fewer seeds must do."""


class _Enough(Exception):
    pass


def ours(nu: torch.Tensor, damping: torch.Tensor, seed: int) -> tuple[float, float]:
    """Return processor seconds and the worst relative error, by the default scheme."""
    begin = time.process_time()
    bank = DampingBank.from_description(NETWORKS, seed)
    fit = fit_damping(bank, DampingProblem(nu, damping), seed=seed, callback=lambda r: max(r.train) <= GOAL)
    return time.process_time() - begin, max(fit.relative_rmse)


def _inputs(nu: np.ndarray) -> np.ndarray:
    scaled = nu / np.sqrt((nu**2).mean(0))
    return np.column_stack([scaled, np.abs(scaled) * scaled, np.ones(len(nu))])


def _start(rng: np.random.Generator) -> np.ndarray:
    bound = [12**-0.5] * (13 * HIDDEN) + [HIDDEN**-0.5] * HIDDEN + [0.0]
    return rng.uniform(-1.0, 1.0, len(bound)) * np.array(bound)


def scipy_trf(nu: np.ndarray, damping: np.ndarray, seed: int) -> tuple[float, float]:
    """Return the same for scipy's least_squares (trf), one network after the other, with an exact Jacobian.

    Each is stopped as soon as it is there, and drawn anew where it ends elsewhere.
    """
    begin, x, worst = time.process_time(), _inputs(nu), 0.0
    for axis in range(6):
        goal = (damping[:, axis] - damping[:, axis].mean()) / damping[:, axis].std()
        rng = np.random.default_rng(100 * seed + axis)

        def residual(theta: np.ndarray, goal: np.ndarray = goal) -> np.ndarray:
            return (
                np.tanh(x @ theta[: 13 * HIDDEN].reshape(HIDDEN, 13).T) @ theta[-HIDDEN - 1 : -1]
                + theta[-1]
                - goal
            )

        def jacobian(theta: np.ndarray) -> np.ndarray:
            units = np.tanh(x @ theta[: 13 * HIDDEN].reshape(HIDDEN, 13).T)
            slope = (1 - units**2) * theta[-HIDDEN - 1 : -1]
            inner = (slope[:, :, None] * x[:, None]).reshape(len(x), -1)
            return np.column_stack([inner, units, np.ones(len(x))])

        def watch(intermediate_result: Any) -> None:
            if np.sqrt(2 * intermediate_result.cost / len(x)) <= GOAL:
                raise StopIteration

        error = np.inf
        while error > GOAL and time.process_time() - begin < BUDGET:
            found = least_squares(residual, _start(rng), jacobian, method="trf", max_nfev=300, callback=watch)
            error = min(error, float(np.sqrt(2 * found.cost / len(x))))
        worst = max(worst, error)
    return time.process_time() - begin, worst


def joint_lbfgs(nu: np.ndarray, damping: np.ndarray, seed: int) -> tuple[float, float]:
    """Return the same for torch's L-BFGS over all six networks at once, as one batched product."""
    begin = time.process_time()
    x = torch.tensor(_inputs(nu))
    goal = torch.tensor((damping - damping.mean(0)) / damping.std(0)).T.contiguous()
    rng = np.random.default_rng(seed)
    start = np.stack([_start(rng) for _ in range(6)])
    inner = torch.tensor(start[:, : 13 * HIDDEN].reshape(6 * HIDDEN, 13), requires_grad=True)
    outer = torch.tensor(start[:, -HIDDEN - 1 : -1], requires_grad=True)
    bias = torch.tensor(start[:, -1:], requires_grad=True)
    best = np.inf

    def errors() -> torch.Tensor:
        hidden = torch.tanh(inner @ x.T).view(6, HIDDEN, -1)
        return ((hidden * outer.unsqueeze(-1)).sum(1) + bias - goal).square().mean(1)

    optimiser = torch.optim.LBFGS(
        [inner, outer, bias], max_iter=20, history_size=50, line_search_fn="strong_wolfe",
        tolerance_grad=0.0, tolerance_change=0.0,
    )  # fmt: skip

    def closure() -> torch.Tensor:
        nonlocal best
        optimiser.zero_grad()
        each = errors()
        best = min(best, float(each.detach().max().sqrt()))
        if best <= GOAL or time.process_time() - begin > BUDGET:
            raise _Enough
        total = each.sum()
        total.backward()
        return total

    try:
        while True:
            optimiser.step(closure)
    except _Enough:
        pass
    return time.process_time() - begin, best


def training(work: Work, seeds: int) -> list[dict[str, Any]]:
    """Return per trainer the median processor seconds over seeds, and how many got there."""
    nu, damping = samples(work.truth, work.command, work.times)
    arrays = nu.numpy(), damping.numpy()
    ours(nu, damping, 99)  # warm
    trainers = {
        "auvnn, default scheme": lambda s: ours(nu, damping, s),
        "scipy least_squares (trf)": lambda s: scipy_trf(*arrays, s),
        SLOWEST: lambda s: joint_lbfgs(*arrays, s),
    }
    results: dict[str, list[tuple[float, float]]] = {name: [] for name in trainers}
    for seed in range(seeds):
        for name, train in trainers.items():
            if name == SLOWEST and seed >= SLOWEST_SEEDS:
                continue
            results[name].append(train(seed))
            print(
                f"  seed {seed}, {name}: {results[name][-1][0]:.2f} s to {results[name][-1][1]:.2e}",
                flush=True,
            )
    found = []
    for name, rows in results.items():
        seconds = [s for s, _ in rows]
        found.append(
            {
                "name": name,
                "cpu_s": float(np.median(seconds)),
                "cpu_spread_s": [float(v) for v in np.quantile(seconds, [0.25, 0.75])],
                "worst_error": max(e for _, e in rows),
                "reached": sum(e <= GOAL * 1.0001 for _, e in rows),
                "seeds": len(rows),
            }
        )
    return found
