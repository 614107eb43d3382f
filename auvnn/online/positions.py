"""Does the velocity lead from one position to the next? A scale of a velocity sensor shows in nothing else.

Between two positions x the way is compared with the integral of the velocity over ground,

    D = x(t2) - x(t1) - integral R(Theta) v dt

over one, three and ten seconds. White noise of the positions enters D at its two ends alone, however many samples lie
between, so that slow sensors and noisy ones are judged by the longer ways. Where the vehicle goes to and fro and D
stays small, the scale g of x = x0 + c t + g integral R v dt over ten seconds, or two dozen rare positions, tells.
Fossen (2011), equation 2.11: p_dot = R v.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.online.residual import Sample
from auvnn.physics.attitude import quat_to_matrix

Array = NDArray[np.float64]

SPANS = (1.0, 3.0, 10.0)  # s
SURE = 6.0  # standard deviations of D
# Mean velocity (m/s) and share of the way by which both may differ without a fault: levers, scales, alignment.
ALLOWED, SHARE = 0.05, 0.25
# A step beyond this many times the usual one, and m, is a position reset: the ways begin again behind it.
ANEW, LEAST = 10.0, 0.2
# Scale of the velocity against the positions that is never blamed on it, and what confirms it.
SCALE, CLOSE = 0.3, 0.15
# The way is confirmed when it is this many times longer than what D leaves open.
CLEAR = 3.0
FEWEST = 4
NODES, STEPS = 512, 64
# Of positions that come rarely so many are kept, for so long (s).
RARE, LONGEST = 24, 40.0
TO_STD = 1.4826 / np.sqrt(6.0)  # of a second difference of white noise


class Positions:
    """Judges the velocity by the positions; once they disagree, until a way confirms them again."""

    def __init__(self) -> None:
        """Start with nothing."""
        self.forget()

    def forget(self) -> None:
        """Start again: another run, or positions that were reset."""
        self._nodes: Array = np.zeros((0, 8))  # t, position, integral of the velocity, its length
        self._steps: Array = np.zeros((0, 4))  # dt, velocity: the last samples
        self._sum: Array = np.zeros(4)
        self.wrong = False

    def disagree(self, last: Sample | None, sample: Sample) -> bool:
        """Take in a sample and say whether the velocity contradicts the positions."""
        position = sample.eta[:3].numpy()
        if last is None or not position.any():
            # Nothing is compared across a hole; what was wrong before it stays wrong until it is confirmed.
            self._nodes, self._sum = self._nodes[:0], np.zeros(4)
            return self.wrong
        dt = sample.t - last.t
        way = 0.5 * dt * (_world(last) + _world(sample))
        self._sum = self._sum + np.append(way, np.linalg.norm(way))
        self._steps = np.concatenate([self._steps, [[dt, *sample.nu[:3].tolist()]]])[-STEPS:]
        if len(self._nodes) and (self._nodes[-1, 1:4] == position).all():
            return self.wrong  # the same fix once more: positions come more rarely than velocities
        self._nodes = np.concatenate([self._nodes, [[sample.t, *position, *self._sum]]])[-NODES:]
        old = sample.t - self._nodes[:, 0]
        recent = np.arange(len(old), 0, -1) <= RARE
        self._nodes = self._nodes[(old <= SPANS[-1] + 0.5) | (recent & (old <= LONGEST))]
        gaps = np.diff(self._nodes[:, 1:4] - self._nodes[:, 4:7], axis=0)
        if len(gaps) > FEWEST and (np.abs(gaps[-1]) > ANEW * np.median(np.abs(gaps), axis=0) + LEAST).any():
            self._nodes = self._nodes[-1:]
        else:
            self._judge(gaps)
        return self.wrong

    def _judge(self, gaps: Array) -> None:
        nodes = self._nodes
        if len(nodes) < FEWEST + 2:
            return
        there = (nodes[:, 1:4] != 0.0).all(0)
        noise = np.sqrt(2.0) * TO_STD * np.median(np.abs(np.diff(gaps, axis=0)), axis=0)
        steps = np.diff(self._steps[:, 1:], n=2, axis=0)
        jitter = TO_STD * float(np.median(np.abs(steps))) if len(steps) > FEWEST else 0.0
        confirmed = contradicted = False
        for span in SPANS:
            first = int(np.searchsorted(nodes[:, 0], nodes[-1, 0] - span - 1e-6))
            time = nodes[-1, 0] - nodes[first, 0]
            if len(nodes) - first < FEWEST or time < 0.7 * span:
                continue
            moved = nodes[-1] - nodes[first]
            apart = np.where(there, np.abs(moved[1:4] - moved[4:7]), 0.0)
            spread = np.sqrt(noise**2 + time * float(self._steps[:, 0].mean()) * jitter**2)
            limit = SURE * spread + ALLOWED * time + SHARE * moved[7]
            contradicted |= bool((apart > limit).any())
            net = float(np.linalg.norm(moved[4:7][there]))
            confirmed |= net > CLEAR * float(np.linalg.norm(apart)) + SURE * float(spread.max())
        scale, error = _scale(nodes[:, 0], nodes[:, 1:4][:, there], nodes[:, 4:7][:, there])
        contradicted |= abs(scale - 1.0) > SCALE + SURE * error
        confirmed |= abs(scale - 1.0) + SURE * error < 2.0 * CLOSE
        self.wrong = contradicted or (self.wrong and not confirmed)

    def state(self) -> dict[str, Tensor]:
        """Return what is remembered."""
        rows = {"nodes": self._nodes, "steps": self._steps, "sum": self._sum}
        return {**{k: torch.tensor(v) for k, v in rows.items()}, "wrong": torch.tensor(self.wrong)}

    def load(self, state: Mapping[str, Tensor]) -> None:
        """Take up a state."""
        self._nodes, self._steps = state["nodes"].numpy().copy(), state["steps"].numpy().copy()
        self._sum, self.wrong = state["sum"].numpy().copy(), bool(state["wrong"])


def _scale(t: Array, x: Array, way: Array) -> tuple[float, float]:
    """Return g of x = x0 + c t + g way over all axes, and its standard error for noise with a memory."""
    if len(t) < 4 * FEWEST or not x.shape[1]:
        return 1.0, np.inf
    time = (t - t.mean())[:, None]
    x, way = (v - v.mean(0) - time * ((time * v).sum(0) / (time * time).sum()) for v in (x, way))
    square = float((way * way).sum())
    if square <= 0.0:
        return 1.0, np.inf
    scale = float((way * x).sum()) / square
    left = x - scale * way
    variance = float((left * left).sum()) / max(left.size - 3 * left.shape[1], 1)
    if variance <= 0.0:
        return scale, 0.0
    memory = min(max(float((left[1:] * left[:-1]).sum() / (left * left).sum()), 0.0), 0.99)
    return scale, float(np.sqrt(variance / square * (1.0 + memory) / (1.0 - memory)))


def _world(sample: Sample) -> Array:
    return (quat_to_matrix(sample.eta[3:]) @ sample.nu[:3]).numpy()
