"""Free runs and their gradients: ours, compiled and plain, against torchdiffeq and JAX."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import peers_torch
import torch
from measure import race
from standard import STEPS, Work

WINDOWS, LENGTH, MANY = 150, 20, 1024


def jax_peer(work: Work) -> Any:
    """Return the peer in JAX, or why there is none."""
    try:
        from peers_jax import Peer
    except ImportError as error:
        return f"not installed ({error.name})"
    return Peer(work)


class Ours:
    """The standard work by auvnn, with a given engine."""

    def __init__(self, work: Work, engine: str) -> None:
        self.work, self.engine = work, engine
        self.model = work.model

    def run(self) -> torch.Tensor:
        w = self.work
        with torch.no_grad():
            run = self.model.rollout(w.eta0, w.nu0, w.command, w.times, engine=self.engine)
        return torch.cat([run.eta, run.nu], -1)

    def _slopes(self, *given: torch.Tensor) -> list[torch.Tensor]:
        for p in self.model.parameters():
            p.grad = None
        run = self.model.rollout(*given, engine=self.engine, check=False)
        run.nu.square().sum().backward()
        return [p.grad for p in self.model.parameters()]

    def run_and_gradient(self) -> list[torch.Tensor]:
        w = self.work
        return self._slopes(w.eta0, w.nu0, w.command, w.times)

    def windows(self, y0: torch.Tensor, command: torch.Tensor, times: torch.Tensor) -> list[torch.Tensor]:
        return self._slopes(y0[:, :7], y0[:, 7:], command, times)

    def many(self, y0: torch.Tensor) -> torch.Tensor:
        w = self.work
        with torch.no_grad():
            return self.model.rollout(
                y0[:, :7], y0[:, 7:], w.command, w.times, engine=self.engine, check=False
            ).nu


def window_data(work: Work) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return the starts (150, 13), commands (150, 21, 6) and times (21) of the manoeuvre cut into windows."""
    states = Ours(work, "compiled").run()
    begin = torch.arange(WINDOWS) * LENGTH
    rows = begin[:, None] + torch.arange(LENGTH + 1)
    return states[begin].contiguous(), work.command[rows], work.times[: LENGTH + 1]


def many_data(work: Work) -> torch.Tensor:
    """Return 1024 starts (1024, 13): at rest but for random velocities."""
    generator = torch.Generator().manual_seed(0)
    y0 = torch.cat([work.eta0, work.nu0]).repeat(MANY, 1)
    y0[:, 7:] = 0.2 * torch.randn(MANY, 6, generator=generator, dtype=torch.float64)
    return y0


def agreement(work: Work, peer: Any) -> dict[str, float]:
    """Return how far the others' answers are from ours, relative to the largest element.

    Raises:
        RuntimeError: JAX states another model.
    """
    ours, plain = Ours(work, "compiled"), Ours(work, "torch")
    states, slopes = ours.run().numpy(), [g.numpy() for g in ours.run_and_gradient()]
    far = lambda a, b: float(np.abs(a - b).max() / np.abs(b).max())  # noqa: E731
    found = {"torch, free run": far(states, plain.run().numpy())}
    if not isinstance(peer, str):
        found["JAX, free run"] = far(np.asarray(peer.run()), states)
        theirs = peer.run_and_gradient()
        pairs = zip(("w1", "b1", "w2", "b2"), slopes, strict=True)
        found["JAX, gradient"] = max(far(np.asarray(theirs[n]).reshape(g.shape), g) for n, g in pairs)
        if max(found["JAX, free run"], found["JAX, gradient"]) > 1e-9:
            raise RuntimeError(f"the statement in JAX is of another model: {found}")
    return found


def free_runs(work: Work, peer: Any, repeats: int) -> dict[str, list[dict[str, Any]]]:
    """Return timings of one free run, and of one with its gradient."""
    ours, plain = Ours(work, "compiled"), Ours(work, "torch")
    own, lean = peers_torch.Own(work), peers_torch.Lean(work)

    def no_gradient(side: torch.nn.Module) -> Callable[[], Any]:
        def go() -> None:
            with torch.no_grad():
                peers_torch.run(side, work)

        return go

    few = repeats // 10
    one = race([
        ("auvnn, compiled", ours.run, repeats),
        ("JAX, jitted scan", peer if isinstance(peer, str) else peer.run, repeats),
        ("auvnn, plain torch", plain.run, few),
        ("torchdiffeq rk4 on our right-hand side", no_gradient(own), few),
        ("torchdiffeq rk4 on the lean one", no_gradient(lean), few),
    ])  # fmt: skip
    two = race([
        ("auvnn, compiled", ours.run_and_gradient, repeats),
        ("JAX, jitted scan", peer if isinstance(peer, str) else peer.run_and_gradient, repeats),
        ("auvnn, plain torch", plain.run_and_gradient, 0),
        ("torchdiffeq rk4, backprop, our right-hand side", lambda: peers_torch.run_and_gradient(own, work), 0),
        ("torchdiffeq rk4, backprop, the lean one", lambda: peers_torch.run_and_gradient(lean, work), 0),
    ])  # fmt: skip
    return {"free run": [t.to_dict() for t in one], "free run and gradient": [t.to_dict() for t in two]}


def windows(work: Work, peer: Any, repeats: int) -> list[dict[str, Any]]:
    """Return timings of 150 windows of 20 steps and their gradient."""
    data = window_data(work)
    arrays = tuple(x.numpy() for x in data)
    ours, plain = Ours(work, "compiled"), Ours(work, "torch")
    found = race([
        ("auvnn, compiled", lambda: ours.windows(*data), repeats),
        ("JAX, vmap of jitted scans", peer if isinstance(peer, str) else lambda: peer.windows(*arrays), repeats),
        ("auvnn, plain torch", lambda: plain.windows(*data), max(3, repeats // 5)),
    ])  # fmt: skip
    return [t.to_dict() for t in found]


def many(work: Work, peer: Any, repeats: int) -> list[dict[str, Any]]:
    """Return timings of 1024 free runs at once."""
    data = many_data(work)
    array = data.numpy()
    ours, plain = Ours(work, "compiled"), Ours(work, "torch")
    found = race([
        ("auvnn, compiled", lambda: ours.many(data), repeats),
        ("JAX, vmap", peer if isinstance(peer, str) else lambda: peer.many(array), repeats),
        ("auvnn, plain torch", lambda: plain.many(data), 0),
    ])  # fmt: skip
    return [t.to_dict() for t in found]


__all__ = ["STEPS", "agreement", "free_runs", "jax_peer", "many", "windows"]
