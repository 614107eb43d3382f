"""Small runs of a vehicle that changes, made by free running; the adapter has no part in them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import torch

import auvnn
from auvnn.damping.bank import DampingBank
from auvnn.logs import Run
from auvnn.models import GreyBox
from auvnn.online import Adapter, Update

RATE = 10.0


@cache
def vehicle() -> GreyBox:
    """The built-in 95 kg vehicle, its drag known, driven by a wrench."""
    return auvnn.load("rov95", actuation="wrench")


def bare() -> GreyBox:
    """The same without any drag: what the paper calls the known part."""
    known = replace(vehicle().vehicle, damping_elements=(), linear_damping=None, quadratic_damping=None)
    return GreyBox(known, actuation="wrench")


def with_networks(seed: int = 0, size: float = 60.0) -> GreyBox:
    """The known part with six networks of the paper's form, untrained."""
    bank = DampingBank.from_description("mlp", seed)
    bank.input_scale.fill_(0.3)
    bank.output_scale.copy_(torch.tensor([size] * 3 + [size / 6] * 3))
    known = bare()
    return GreyBox(known.vehicle, (), bank, "wrench")


def wrench(duration: float, rate: float = RATE, seed: int = 0) -> np.ndarray:
    """Six sums of sines whose frequencies are all different."""
    t = np.arange(round(duration * rate) + 1) / rate
    generator = np.random.default_rng(seed)
    size = np.array([80.0, 80.0, 120.0, 15.0, 15.0, 12.0])
    out = np.zeros((len(t), 6))
    for axis in range(6):
        for k in range(4):
            frequency = 0.05 * (1 + axis + 6 * k) * generator.uniform(0.9, 1.1)
            out[:, axis] += np.sin(2 * np.pi * frequency * t + generator.uniform(0, 2 * np.pi)) / 2
    return out * size


def driven(
    before: GreyBox,
    after: Callable[[GreyBox], GreyBox] | None = None,
    *,
    when: float = 8.0,
    duration: float = 20.0,
    rate: float = RATE,
    command: np.ndarray | None = None,
    noise: tuple[float, float] = (0.0, 0.0),
    seed: int = 0,
    step: float = 0.05,
) -> Run:
    """A run of `before`, which becomes `after(before)` at a moment; noise of velocity and acceleration."""
    held = wrench(duration, rate, seed) if command is None else command
    t = np.arange(len(held)) / rate
    cut = round(when * rate) if after is not None else len(t) - 1
    later = before if after is None else after(before)
    times, commands = torch.tensor(t), torch.tensor(held)
    start = torch.tensor([0.5, 0.5, 5.0, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    with torch.no_grad():
        first = before.rollout(
            start, torch.zeros(6).double(), commands[: cut + 1], times[: cut + 1], max_step=step
        )
        eta, nu = first.eta, first.nu
        if cut < len(t) - 1:
            rest = later.rollout(eta[-1], nu[-1], commands[cut:], times[cut:], max_step=step)
            eta, nu = torch.cat([eta[:-1], rest.eta]), torch.cat([nu[:-1], rest.nu])
        rate_before = before(eta[:cut], nu[:cut], commands[:cut])
        nu_dot = torch.cat([rate_before, later(eta[cut:], nu[cut:], commands[cut:])]).numpy()
    generator = np.random.default_rng(seed + 1)
    drawn = generator.standard_normal((2, len(t), 6)) * np.array([1, 1, 1, 0.5, 0.5, 0.5])
    return Run(
        0, t, eta[:, 3:].numpy(), nu.numpy() + noise[0] * drawn[0], nu_dot=nu_dot + noise[1] * drawn[1],
        position=eta[:, :3].numpy(), wrench=held,
    )  # fmt: skip


def fed(
    adapter: Adapter, run: Run, rows: range | None = None, *, measured: bool = True, **options: Any
) -> list[Update]:
    """Take a run's rows one by one."""
    out = []
    for k in rows if rows is not None else range(run.samples):
        rate = run.nu_dot[k] if measured and run.nu_dot is not None else None
        assert run.wrench is not None
        out.append(adapter.step(run.t[k], run.eta[k], run.nu[k], run.wrench[k], rate, **options))
    return out


def parameters(adapter: Adapter) -> torch.Tensor:
    """All parameters of the subnetworks as one vector."""
    return torch.cat([v.flatten() for v in adapter.snapshot().values()])
