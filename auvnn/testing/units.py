"""A change of units: physics must not notice it, so a parameter's declared unit can be checked by it."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from auvnn.models import Inputs
from auvnn.testing.scene import Scene
from auvnn.vehicle import Vehicle

# Powers of (mass, length, time) of the SI units in use; an angle is a number, a voltage stays what it is.
UNITS = {
    "1": (0, 0, 0),
    "kg": (1, 0, 0),
    "m": (0, 1, 0),
    "s": (0, 0, 1),
    "N": (1, 1, -2),
    "rad": (0, 0, 0),
    "V": (0, 0, 0),
    "Pa": (1, -1, -2),
    "J": (1, 2, -2),
    "W": (1, 2, -3),
    "Hz": (0, 0, -1),
}
_FACTOR = re.compile(r"([A-Za-z1]+?)(-?\d+)?")


def powers(unit: str) -> tuple[int, int, int]:
    """Return the powers of mass, length and time of a unit such as "N s2/m" or "1/m".

    Raises:
        AssertionError: the unit is not written in SI units.
    """
    if not unit.strip() or unit.count("/") > 1:
        raise AssertionError(f"unit {unit!r} is not SI: write it like 'm/s', 'N s2/m2' or '1'")
    total = np.zeros(3, dtype=int)
    for part, sign in zip(unit.split("/"), (1, -1), strict=False):
        for factor in part.split():
            match = _FACTOR.fullmatch(factor)
            if match is None or match[1] not in UNITS:
                raise AssertionError(f"unit {unit!r} is not SI: write it like 'm/s', 'N s2/m' or '1'")
            total += sign * int(match[2] or 1) * np.array(UNITS[match[1]])
    return int(total[0]), int(total[1]), int(total[2])


@dataclass(frozen=True)
class Units:
    """New units: one kg is `mass` of the new ones, one m is `length`, one s is `time`."""

    mass: float = 1.3
    length: float = 0.8
    time: float = 1.25

    def factor(self, unit: str) -> float:
        """Return by what the numbers of a unit are multiplied."""
        mass, length, time = powers(unit)
        return self.mass**mass * self.length**length * self.time**time

    def six(self, translation: str, rotation: str) -> np.ndarray:
        """Return six factors, of two units."""
        return np.array([self.factor(translation)] * 3 + [self.factor(rotation)] * 3)

    def vehicle(self, old: Vehicle) -> Vehicle:
        """Return the same vehicle by other numbers."""
        force, speed, rate = self.six("N", "N m"), self.six("m/s", "1/s"), self.six("m/s2", "1/s2")
        metre, newton = self.factor("m"), self.factor("N")

        def scaled(matrix: Any, by: np.ndarray) -> Any:
            return None if matrix is None else matrix * force[:, None] / by[None, :]

        return replace(
            old,
            gravity=old.gravity * self.factor("m/s2"),
            water_density=old.water_density * self.factor("kg/m3"),
            mass=old.mass * self.mass,
            buoyancy=old.buoyancy * newton,
            length=old.length * metre,
            center_of_gravity=old.center_of_gravity * metre,
            center_of_buoyancy=old.center_of_buoyancy * metre,
            inertia=old.inertia * self.factor("kg m2"),
            added_mass=scaled(old.added_mass, rate),
            linear_damping=scaled(old.linear_damping, speed),
            quadratic_damping=scaled(old.quadratic_damping, speed**2),
            damping_elements=tuple(
                replace(
                    e,
                    position=e.position * metre,
                    linear=e.linear * force / speed,
                    quadratic=e.quadratic * force / speed**2,
                )
                for e in old.damping_elements
            ),
            thrusters=tuple(
                replace(
                    u,
                    position=u.position * metre,
                    max_forward=u.max_forward * newton,
                    max_reverse=u.max_reverse * newton,
                    curve=u.curve
                    if isinstance(u.curve, str)
                    else replace(u.curve, thrust=u.curve.thrust * newton),
                )
                for u in old.thrusters
            ),
            fins=tuple(replace(f, position=f.position * metre, area=f.area * metre**2) for f in old.fins),
        )

    def scene(self, old: Scene, actuation: str) -> Scene:
        """Return the same runs by other numbers."""
        i = old.inputs
        command = i.command * torch.tensor(self.six("N", "N m")) if actuation == "wrench" else i.command
        altitude = None if i.altitude is None else i.altitude * self.length
        place = torch.tensor([self.length] * 3 + [1.0] * 4, dtype=old.eta.dtype)
        return Scene(
            old.eta * place,
            old.nu * torch.tensor(self.six("m/s", "1/s")),
            Inputs(command, i.fins, i.voltage, altitude),
            old.times * self.time,
            old.warmup,
        )

    def outputs(self, old: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
        """Return what `Predictor` should answer in the new units."""
        speed, rate = self.six("m/s", "1/s").tolist(), self.six("m/s2", "1/s2").tolist()
        state = [*[self.length] * 3, *[1.0] * 4, *speed]
        rows = {"nu_dot": rate, "rollout": state, "sense": [*state, *rate]}
        return {
            name: (
                value.unflatten(-1, (-1, len(rows[name]))) * torch.tensor(rows[name], dtype=value.dtype)
            ).flatten(-2)
            for name, value in old.items()
        }
