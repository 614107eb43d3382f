"""First-order waves from the surface above."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Extent, Moment, Parameter, Unexplained
from auvnn.physics.products import matvec

Array = NDArray[Any]
SLOWEST, FASTEST = 0.4, 2.2
"""Angular frequencies between which waves reach an underwater vehicle, rad/s: periods of 16 to 3 s."""
MOST = 24
"""Frequencies that are asked for at most."""
FINEST, WORK = 400, 6e6
"""Frequencies that what is left is compared with at most; waves times moments, beyond which some moments are left out."""
GRAVITY = 9.81
"""Of the waves that what is left is compared with, m/s2; those of the effect have the vehicle's own."""
CLOSE = 200
"""Waves that look most like some moments and are compared with all of them."""
LIKELIEST = 8
"""Waves that are asked for where what a fit leaves is known."""
LOOKS = 6
"""Closer looks: at frequency and phase, and at the direction, in turn."""


class Waves(Effect):
    """A regular wave in deep water: elevation a cos(k xi - omega t + phase), xi along `direction`, omega^2 = g k.

    The water moves by u = a omega e^(-kz) cos(.) along `direction` and w = -a omega e^(-kz) sin(.) downwards
    (so that its divergence vanishes), and pushes the displaced volume by rho V times its acceleration
    (Froude-Krylov), at the centre of buoyancy; added mass and drag feel the relative motion. `direction` is where
    the wave goes, from north towards east. The vehicle is small against the wave's length.
    Reference: Faltinsen (1990), chapters 2 and 3; Turner et al. (2021), J. OMAE 143(3):031202.
    """

    name = "waves"
    cause = "waves move the water"
    symbol = "zeta_a"
    reference = "Faltinsen (1990), Sea Loads on Ships and Offshore Structures, chapters 2 and 3"
    confused_with = ("ocean_current",)
    manoeuvre = "survey"
    told_apart_by = "straight legs at constant depth, long enough for twenty periods, and again deeper"
    channels = ("x", "y", "z")

    @classmethod
    def describe(cls, vehicle: Any, actuation: str) -> tuple[Parameter, ...]:
        """Return amplitude, angular frequency, phase and direction."""
        return (
            Parameter("amplitude", "m", 0.0, 0.3, -10.0, 10.0),
            Parameter("omega", "rad/s", 0.9, 0.3, 0.05, 10.0, shape=True),
            Parameter("phase", "rad", 0.0, 1.0, -50.0, 50.0, shape=True),
            Parameter("direction", "rad", 0.0, 1.0, -50.0, 50.0, shape=True),
        )

    @classmethod
    def starts(cls, parameters: tuple[Parameter, ...], extent: Extent) -> list[dict[str, float]]:
        """Return frequencies as close as the longest run resolves, each in two phases and three directions.

        Where what a fit leaves is known, those whose wave it looks most like: to a vehicle that moves by several lengths
        of a wave, each direction is another one.
        """
        if extent.left is not None:
            return _likeliest(extent, extent.left)
        count, step = _frequencies(extent)
        return [
            {"omega": SLOWEST + k * step, "phase": phase, "direction": turn * 2 * math.pi / 3}
            for k in range(count)
            for phase in (0.0, math.pi / 2)
            for turn in range(3)
        ]

    @classmethod
    def closest(
        cls, parameters: tuple[Parameter, ...], extent: Extent, shape: dict[str, float], level: int
    ) -> list[dict[str, float]]:
        """Return frequencies, phases and directions around the ones found, each time nearer, in turn.

        A frequency between two that were tried is out of phase at both ends of a run: what it explains is a part of what
        the right one does, and a fit that begins there ends in another minimum. With the frequency the phase moves so
        that it stays what it was in the middle of the log.
        """
        if level >= LOOKS:
            return []
        near = 2.0 ** -(level // 2 + 1)
        if level % 2:
            turns = (-2.0, -1.0, 1.0, 2.0) if level == 1 else (-1.0, 1.0)
            return [
                {**shape, "direction": _turned(shape["direction"] + k * near * math.pi / 3)} for k in turns
            ]
        step, middle = near * _step(extent), extent.begin + 0.5 * extent.duration
        return [
            {
                **shape,
                "omega": shape["omega"] + k * step,
                "phase": _turned(shape["phase"] + k * step * middle + j * near * math.pi / 2),
            }
            for k in (-1, 0, 1)
            for j in (-1, 0, 1)
            if (k, j) != (0, 0)
        ]

    @classmethod
    def told(cls, values: dict[str, float]) -> dict[str, float]:
        """Return the wave with an amplitude above zero and angles within half a turn: it is the same wave."""
        out = dict(values)
        if out["amplitude"] < 0:
            out["amplitude"], out["phase"] = -out["amplitude"], out["phase"] + math.pi
        return out | {n: _turned(out[n]) for n in ("phase", "direction")}

    def settle(self, vehicle: Any, actuation: str) -> None:
        """Keep gravity."""
        self.keep("gravity", vehicle.gravity)

    def water(self, moment: Moment) -> tuple[Tensor, Tensor]:
        """Return the water's velocity and its rate of change in place."""
        amplitude, omega, phase, direction = self.theta.to(moment.position).unbind(-1)
        number = omega * omega / self.kept("gravity").to(omega)
        ahead = torch.stack([torch.cos(direction), torch.sin(direction)], dim=-1)
        north_east = moment.position[..., :2]
        angle = number * (north_east * ahead).sum(-1) - omega * moment.time.to(omega) + phase
        speed = amplitude * omega * torch.exp(-number * moment.position[..., 2].clamp_min(0.0))
        cos, sin = speed * torch.cos(angle), speed * torch.sin(angle)
        velocity = torch.cat([cos.unsqueeze(-1) * ahead, -sin.unsqueeze(-1)], dim=-1)
        rate = torch.cat([sin.unsqueeze(-1) * ahead, cos.unsqueeze(-1)], dim=-1)
        return velocity, omega * rate

    def wrench(self, moment: Moment, body: Body) -> Tensor:
        """Return the Froude-Krylov force."""
        _, acceleration = self.water(moment)
        displaced = body.buoyancy / self.kept("gravity").to(acceleration)
        force = displaced.unsqueeze(-1) * matvec(moment.rotation.mT, acceleration)
        return torch.cat([force, torch.linalg.cross(body.cb.expand_as(force), force)], dim=-1)


def _turned(angle: float) -> float:
    """Return an angle within half a turn, rad."""
    return math.remainder(angle, 2 * math.pi)


def _step(extent: Extent) -> float:
    """Return how far frequencies that are asked for are apart, rad/s; where what is left is known, as runs resolve."""
    if extent.left is None:
        return _frequencies(extent)[1]
    return max(2 * math.pi / max(extent.longest, 4.0), 2 * (FASTEST - SLOWEST) / FINEST)


def _frequencies(extent: Extent) -> tuple[int, float]:
    """Return how many frequencies are asked for, as close as the longest run resolves, and their distance, rad/s."""
    count = min(max(math.ceil((FASTEST - SLOWEST) * extent.longest / (2 * math.pi)) + 1, 6), MOST)
    return count, (FASTEST - SLOWEST) / (count - 1)


def _likeliest(extent: Extent, left: Unexplained) -> list[dict[str, float]]:
    """Return the shapes of waves whose acceleration what is left looks most like, each in four phases.

    A wave accelerates the water by sin(angle) along its direction and by cos(angle) downwards, and the vehicle by some of
    that, later or earlier: the power of both at the wave's angle, whatever their phase, says how much of what is left is
    such a wave (a matched filter; Kay 1998, Fundamentals of Statistical Signal Processing II, chapter 4).
    """
    step = _step(extent)
    omegas = np.arange(SLOWEST, FASTEST + 0.25 * step, 0.5 * step)
    span = _span(left)
    turns = [_directions(omega, span) for omega in omegas]
    # Of moments at even distances one wave is like another.
    count = min(len(left.time), max(64, int(WORK / sum(turns))))
    some = np.random.default_rng(0).permutation(len(left.time))[:count]
    found: list[tuple[float, float, float]] = []
    for omega, size in zip(omegas, turns, strict=True):
        directions = 2 * math.pi * np.arange(size) / size
        power = _power(left, some, float(omega), directions)
        found += [(float(p), float(omega), float(d)) for p, d in zip(power, directions, strict=True)]
    found.sort(reverse=True)
    if count < len(left.time):
        whole = np.arange(len(left.time))
        found = [(float(_power(left, whole, o, np.array([d]))[0]), o, d) for _, o, d in found[:CLOSE]]
        found.sort(reverse=True)
    kept: list[tuple[float, float]] = []
    for _, omega, direction in found:
        if all(abs(omega - o) > step or abs(_turned(direction - d)) > 0.3 for o, d in kept):
            kept.append((omega, direction))
        if len(kept) == LIKELIEST:
            break
    return [
        {"omega": omega, "phase": float(phase), "direction": direction}
        for omega, direction in kept
        for phase in np.arange(4) * math.pi / 4
    ]


def _power(left: Unexplained, some: Array, omega: float, directions: Array) -> Array:
    """Return how much of what is left at some moments is a wave, by direction, (D,)."""
    place, acceleration = left.position[some], left.acceleration[some]
    acceleration = acceleration - acceleration.mean(0)
    level, upright = np.maximum(
        [0.5 * (acceleration[:, :2] ** 2).sum(), (acceleration[:, 2] ** 2).sum()], 1e-30
    )
    number, ahead = omega**2 / GRAVITY, np.stack([np.cos(directions), np.sin(directions)])
    angle = number * place[:, :2] @ ahead - omega * left.time[some, None]
    wave = np.exp(-number * np.maximum(place[:, 2:], 0.0) - 1j * angle)
    along = (wave * (acceleration[:, :2] @ ahead)).sum(0)
    power = np.abs(along) ** 2 / level + np.abs(acceleration[:, 2] @ wave) ** 2 / upright
    return np.asarray(power / np.maximum((np.abs(wave) ** 2).sum(0), 1e-30), dtype=np.float64)


def _span(left: Unexplained) -> float:
    """Return how far the vehicle went, m."""
    return float(np.linalg.norm(np.ptp(left.position[:, :2], axis=0)))


def _directions(omega: float, span: float) -> int:
    """Return how many directions there are that differ by half a radian of the wave's angle over the way, 180 at most."""
    return int(np.clip(math.ceil(2 * math.pi * omega**2 / GRAVITY * span), 6, 180))
