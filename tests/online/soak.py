"""Hours of samples with faults at random and a vehicle that changes: what an adapter makes of them, by the truth.

The plant's drag is not the model's, and at half-time it grows. Sensors are noisy, and about once a minute one of them
fails. Errors are judged where nobody is fooled: the model's acceleration against the plant's, both at the plant's true
state and under the command that acts. `python -m tests.online.soak 7200` prints the measured figures.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from auvnn.models import GreyBox
from auvnn.online import Adapter, Update
from tests.online.online_world import vehicle

RATE = 20.0
MINUTE = round(60 * RATE)
NOISE = np.array([0.005] * 3 + [0.002] * 3)  # m/s and rad/s
FIX, TURN = 0.02, 1e-3  # m; of each component of the quaternion
BEFORE, AFTER = 1.15, 1.8  # times the drag that the model states
# Kinds of faults, and how long each lasts, s.
FAULTS = {
    "not_finite": 1.0, "spike": 0.04, "frozen": 3.0, "twice": 2.0, "late": 2.0, "lost": 4.0, "no_rotation": 0.5,
    "gyro_bias": 15.0, "scaled": 15.0, "jump": 60.0,
}  # fmt: skip
RESTORES, TWINS = 10, 40


@dataclass
class Measured:
    """What came of it.

    Attributes:
        samples: that the adapter was given.
        worst_minute: largest ratio of the adapted to the frozen model's error over 60 s, and where it began, s.
        halved_after: s from the change until the error over the 10 s before was half the frozen model's.
        after_a_minute: ratio over the last 10 s of the minute after the change.
        ratios: over the first and the second half.
        memory: MB at a tenth of the time, and the largest after it.
        restored: how often the state was saved and restored, each time going on bit for bit.
        faults: how many of each kind.
        counts: of the adapter.
    """

    samples: int = 0
    worst_minute: tuple[float, float] = (0.0, 0.0)
    halved_after: float = float("inf")
    after_a_minute: float = float("inf")
    ratios: tuple[float, float] = (0.0, 0.0)
    memory: tuple[float, float] = (0.0, 0.0)
    restored: int = 0
    faults: dict[str, int] = field(default_factory=dict)
    counts: dict[str, object] = field(default_factory=dict)


def dragged(factor: float) -> GreyBox:
    """The vehicle with all its drag times a factor."""
    known = vehicle().vehicle
    parts = [
        replace(e, linear=e.linear * factor, quadratic=e.quadratic * factor) for e in known.damping_elements
    ]
    return GreyBox(replace(known, damping_elements=tuple(parts)), actuation="wrench")


def wrenches(minute: int) -> np.ndarray:
    """A minute of commands: five slow sines for each degree of freedom, others each minute."""
    t = np.arange(MINUTE + 1) / RATE
    generator = np.random.default_rng([7, minute])
    phase, frequency = generator.uniform(0, 2 * np.pi, (6, 5, 1)), generator.uniform(0.03, 0.5, (6, 5, 1))
    size = np.array([80.0, 80.0, 80.0, 6.0, 6.0, 12.0])
    return (np.sin(2 * np.pi * frequency * t + phase).sum(1).T / 2.0) * size


def minutes(count: int, change: int) -> Iterator[tuple[Tensor, Tensor, Tensor, Tensor]]:
    """Yield true eta (n, 7), nu (n, 6), command (n, 6) and acceleration (n, 6) of each minute."""
    plants = [dragged(BEFORE), dragged(AFTER)]
    eta = torch.tensor([0.5, 0.5, 5.0, 1.0, 0.0, 0.0, 0.0], dtype=torch.float64)
    nu = torch.zeros(6, dtype=torch.float64)
    times = torch.arange(MINUTE + 1, dtype=torch.float64) / RATE
    for minute in range(count):
        plant, command = plants[minute >= change], torch.tensor(wrenches(minute))
        with torch.no_grad():
            run = plant.rollout(eta, nu, command, times, max_step=0.05)
            rate = plant(run.eta[:-1], run.nu[:-1], command[:-1])
        yield run.eta[:-1], run.nu[:-1], command[:-1], rate
        eta, nu = run.eta[-1].clone(), run.nu[-1].clone()


class Sensors:
    """Noise, and one fault in most minutes."""

    def __init__(self, seed: int) -> None:
        """Begin."""
        self.random = np.random.default_rng(seed)
        self.faults = dict.fromkeys(FAULTS, 0)

    def minute(self, eta: np.ndarray, nu: np.ndarray) -> Iterator[tuple[int, str, np.ndarray, np.ndarray]]:
        """Yield row, fault and what is measured, in the order in which it comes."""
        kind = str(self.random.choice([*FAULTS, "none"]))
        begin = int(self.random.integers(0, MINUTE - round(15 * RATE)))
        end = begin if kind == "none" else begin + max(1, round(FAULTS[kind] * RATE))
        if kind != "none":
            self.faults[kind] += 1
        eta = eta + np.concatenate([np.full(3, FIX), np.full(4, TURN)]) * self.random.standard_normal(
            eta.shape
        )
        nu = nu + NOISE * self.random.standard_normal(nu.shape)
        axis = int(self.random.integers(0, 6))
        for k in range(MINUTE):
            own, speed, fault = eta[k].copy(), nu[k].copy(), kind if begin <= k < end else ""
            if fault == "lost":
                continue
            if fault == "not_finite":
                (own if axis % 2 else speed)[axis] = self.random.choice([np.nan, np.inf])
            elif fault == "spike":
                speed[axis] += self.random.choice([-2.0, 2.0])
            elif fault == "frozen":
                speed[axis] = nu[begin, axis]
            elif fault == "no_rotation":
                own[3:] = 0.0
            elif fault == "gyro_bias":
                speed[3 + axis % 3] += 0.2
            elif fault == "scaled":
                speed[:3] *= 3.0
            elif fault == "jump":
                own[:3] += [10.0, -4.0, 0.0]
            yield k, fault, own, speed
            if fault == "twice":
                yield k, fault, own, speed
            elif fault == "late" and k > 10:
                yield k - 10, fault, eta[k - 10], nu[k - 10]


def resident() -> float:
    """Memory of this process, MB."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def soak(seconds: int = 7200, learner: str = "rls", seed: int = 0, watch: bool = True) -> Measured:
    """Feed an adapter and measure."""
    count = seconds // 60
    change = count // 2
    frozen, adapter = vehicle(), Adapter(vehicle(), learner, watch=watch)
    sensors, found = Sensors(seed), Measured()
    saves = set(np.linspace(1, count - 1, RESTORES).astype(int).tolist())
    scale = adapter.weights.bank.output_scale
    inertia = frozen.prepare().total.detach()
    errors: list[tuple[float, float]] = []  # of each second: mean squares, adapted and frozen
    memory: list[float] = []
    with tempfile.TemporaryDirectory() as place:
        for minute, (eta, nu, command, rate) in enumerate(minutes(count, change)):
            models: list[GreyBox] = []
            twin: Adapter | None = None
            left = 0
            with torch.no_grad():
                before = ((frozen(eta, nu, command) - rate) @ inertia.mT / scale).square().mean(1)
            for k, _, own, speed in sensors.minute(eta.numpy(), nu.numpy()):
                while len(models) <= k // RATE:
                    models.append(adapter.model)
                if minute in saves and k >= 200 and twin is None:
                    adapter.save(Path(place) / "state")
                    twin, left = Adapter.restore(Path(place) / "state"), TWINS
                t = minute * 60.0 + k / RATE
                update = adapter.step(t, own, speed, command[k])
                found.samples += 1
                if twin is not None and left:
                    same(update, twin.step(t, own, speed, command[k]), adapter, twin)
                    left -= 1
                    if not left:
                        adapter, found.restored = twin, found.restored + 1
            models += [adapter.model] * (60 - len(models))
            for second, model in enumerate(models[:60]):
                rows = slice(round(second * RATE), round((second + 1) * RATE))
                with torch.no_grad():
                    wrong = (model(eta[rows], nu[rows], command[rows]) - rate[rows]) @ inertia.mT / scale
                errors.append((float(wrong.square().mean()), float(before[rows].mean())))
            memory.append(resident())
            if os.environ.get("SOAK_TOLD"):
                a, b = np.sqrt(np.mean(errors[-60:], axis=0))
                print(minute, round(a / b, 3), {k: v for k, v in adapter.counts.skipped.items() if v},
                      adapter.counts.adapted, adapter.counts.reverted, memory[-1], flush=True)  # fmt: skip
    return judged(np.array(errors), memory, change * 60, found, sensors, adapter)


def same(ours: Update, theirs: Update, adapter: Adapter, twin: Adapter) -> None:
    """Insist that an adapter and its restored twin did the same, bit for bit."""
    assert ours.cause == theirs.cause, (ours.cause, theirs.cause)
    for name in ("residual", "prediction_error", "unadapted_error"):
        a, b = getattr(ours, name), getattr(theirs, name)
        assert (a is None) == (b is None) and (a is None or torch.equal(a, b)), name
    assert torch.equal(adapter.weights.read(), twin.weights.read())


def judged(
    errors: np.ndarray, memory: list[float], change: int, found: Measured, sensors: Sensors, adapter: Adapter
) -> Measured:
    """Work the figures out from mean squares (seconds, 2)."""
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(errors, axis=0)])

    def ratio(first: int, last: int) -> float:
        adapted, frozen = sums[last] - sums[first]
        return float(np.sqrt(adapted / frozen))

    each = [ratio(k, k + 60) for k in range(len(errors) - 59)]
    worst = int(np.argmax(each))
    found.worst_minute = each[worst], float(worst)
    after = [k for k in range(change + 10, min(change + 300, len(errors))) if ratio(k - 10, k) <= 0.5]
    found.halved_after = float(after[0] - change) if after else float("inf")
    found.after_a_minute = ratio(change + 50, change + 60)
    found.ratios = ratio(0, change), ratio(change, len(errors))
    warm = max(len(memory) // 10, 1)
    found.memory = memory[warm], max(memory[warm:])
    found.faults = sensors.faults
    found.counts = asdict(adapter.counts)
    return found


if __name__ == "__main__":
    torch.set_num_threads(1)
    seconds = int(sys.argv[1]) if len(sys.argv) > 1 else 7200
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    print(json.dumps(asdict(soak(seconds, *sys.argv[2:3], seed=seed)), indent=1))
