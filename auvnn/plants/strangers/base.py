"""What a stranger is: a wrench with one strength, zero at strength zero, and the degree of freedom it pushes most."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]

AXES = ("X", "Y", "Z", "K", "M", "N")


@dataclass(frozen=True)
class Seen:
    """What a stranger may depend on; SI, NED and FRD.

    Attributes:
        vehicle: its plain numbers.
        t: s.
        place: NED, m, (R, 3).
        rotation: body to NED, (R, 3, 3).
        flow: velocity through the water, (R, 3).
        turn: angular rate, (R, 3).
        thrust: wrench of the actuators, N and N m, (R, 6).
    """

    vehicle: Vehicle
    t: float
    place: Array
    rotation: Array
    flow: Array
    turn: Array
    thrust: Array

    @property
    def heading(self) -> Array:
        """Yaw, rad, (R,)."""
        return np.arctan2(self.rotation[:, 1, 0], self.rotation[:, 0, 0])

    @property
    def pitch(self) -> Array:
        """Pitch, rad, (R,)."""
        return -np.arcsin(np.clip(self.rotation[:, 2, 0], -1.0, 1.0))


class Stranger(ABC):
    """A wrench that no effect of the catalogue makes; its one parameter is `strength`, a pure number.

    A strength of one is about two per cent of the vehicle's weight, and a tenth of the length as the arm of a
    moment: the size that the catalogue calls plausible for a constant force.
    """

    name: ClassVar[str]
    axis: ClassVar[str]
    """The degree of freedom that it pushes most: X, Y, Z, K, M or N."""

    @classmethod
    def checked(cls, values: Mapping[str, float] | None, generator: np.random.Generator) -> dict[str, float]:
        """Return parameters; where none are given, a strength of half to one, of random sign.

        Raises:
            ConfigError: another parameter than `strength`, or no finite number.
        """
        if not values:
            return {"strength": float(generator.choice([-1.0, 1.0]) * generator.uniform(0.5, 1.0))}
        for key, value in values.items():
            if key != "strength":
                raise ConfigError(unknown_name(f"parameter of {cls.name}", str(key), ["strength"]))
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
                raise ConfigError(f"{cls.name}.strength = {value!r}: a finite number is needed, such as 1.0")
        return {"strength": float(values["strength"])}

    @classmethod
    def wrench(cls, values: Mapping[str, float], seen: Seen) -> Array:
        """Return the wrench on the body about its origin, N and N m, (R, 6)."""
        strength = float(values["strength"])
        return strength * cls.unit(seen)

    @classmethod
    @abstractmethod
    def unit(cls, seen: Seen) -> Array:
        """Return the wrench at a strength of one, (R, 6)."""

    @staticmethod
    def force(vehicle: Vehicle) -> float:
        """Return two per cent of the weight, N."""
        return 0.02 * vehicle.weight

    @classmethod
    def moment(cls, vehicle: Vehicle) -> float:
        """Return that at a tenth of the length, N m."""
        return 0.1 * vehicle.length * cls.force(vehicle)

    @classmethod
    def along(cls, size: Array) -> Array:
        """Return a wrench (R, 6) of a size (R,) along the stranger's own axis."""
        out = np.zeros((len(size), 6))
        out[:, AXES.index(cls.axis)] = size
        return out
