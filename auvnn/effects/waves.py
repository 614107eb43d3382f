"""First-order waves from the surface above."""

from __future__ import annotations

import math
from typing import Any

import torch
from torch import Tensor

from auvnn.effects.base import Effect
from auvnn.effects.hooks import Body, Extent, Moment, Parameter
from auvnn.physics.products import matvec

SLOWEST, FASTEST = 0.4, 2.2
"""Angular frequencies between which waves reach an underwater vehicle, rad/s: periods of 16 to 3 s."""
MOST = 24
"""Frequencies that are asked for at most."""


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
        """Return frequencies as close as the longest run resolves, each in two phases and three directions."""
        count = math.ceil((FASTEST - SLOWEST) * extent.longest / (2 * math.pi)) + 1
        step = (FASTEST - SLOWEST) / (min(max(count, 6), MOST) - 1)
        return [
            {"omega": SLOWEST + k * step, "phase": phase, "direction": turn * 2 * math.pi / 3}
            for k in range(min(max(count, 6), MOST))
            for phase in (0.0, math.pi / 2)
            for turn in range(3)
        ]

    @classmethod
    def told(cls, values: dict[str, float]) -> dict[str, float]:
        """Return the wave with an amplitude above zero and angles within half a turn: it is the same wave."""
        out = dict(values)
        if out["amplitude"] < 0:
            out["amplitude"], out["phase"] = -out["amplitude"], out["phase"] + math.pi
        return out | {n: math.remainder(out[n], 2 * math.pi) for n in ("phase", "direction")}

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
