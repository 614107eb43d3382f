"""What a reduced model leaves out, and the parts of a glider that move it: ballast and moving mass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from auvnn.errors import ModelError
from auvnn.vehicle.fields import Fields

PLANES = {"full": (0, 1, 2, 3, 4, 5), "vertical": (0, 2, 4), "horizontal": (0, 1, 5)}
ATTITUDES = ("free", "measured")


@dataclass(frozen=True)
class Reduced:
    """Which degrees of freedom a model has.

    Forces of constraint hold the others still: with S the degrees of freedom that are left, M_SS nu_dot_S = tau_S.

    Attributes:
        plane: "full", "vertical" (surge, heave, pitch) or "horizontal" (surge, sway, yaw).
        attitude: "free", or "measured": the measured attitude turns the vehicle, and moments are not modelled.
    """

    plane: str = "full"
    attitude: str = "free"

    def __bool__(self) -> bool:
        """Whether anything is left out."""
        return self != Reduced()

    @property
    def kept(self) -> tuple[int, ...]:
        """Degrees of freedom that move, 0 to 5."""
        return PLANES[self.plane]

    @property
    def moved(self) -> tuple[int, ...]:
        """Those of them that forces and moments move."""
        return tuple(k for k in self.kept if k < 3 or self.attitude == "free")

    @property
    def turned(self) -> tuple[int, ...]:
        """Those of them that follow the measured attitude."""
        return tuple(k for k in self.kept if k not in self.moved)

    @classmethod
    def read(cls, data: Any, where: str) -> Reduced:
        """Return the reduction that a model file states.

        Raises:
            ModelError: an unknown key or word.
        """
        fields = Fields(data, where, "reduced", ("plane", "attitude"))
        plane, attitude = fields.text("plane", "full"), fields.text("attitude", "free")
        if plane not in PLANES:
            raise fields.refuse("plane", "not a plane", f"choose from {', '.join(PLANES)}")
        if attitude not in ATTITUDES:
            raise fields.refuse("attitude", "unknown", f"choose from {', '.join(ATTITUDES)}")
        return cls(plane, attitude)

    def to_dict(self) -> dict[str, str]:
        """Return the entry of a model file."""
        return {"plane": self.plane, "attitude": self.attitude}


@dataclass(frozen=True)
class Ballast:
    """A volume that changes at constant mass: the log's `ballast`, m3, larger is lighter.

    Attributes:
        position: from the body origin, m.
    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @classmethod
    def read(cls, data: Any, where: str) -> Ballast:
        """Return the ballast that a model file states."""
        fields = Fields({} if data is None or data is True else data, where, "ballast", ("position",))
        position = fields.array("position", (3,)) if fields.has("position") else np.zeros(3)
        return cls(tuple(position.tolist()))  # type: ignore[arg-type]

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of a model file."""
        return {"position": list(self.position)}


@dataclass(frozen=True)
class MovingMass:
    """A mass that is shifted: the log's `moving_mass`, m along its axis from where the stated centre of gravity has it.

    Attributes:
        mass: kg.
        axis: of the shift, a unit vector in body axes.
    """

    mass: float
    axis: tuple[float, float, float] = (1.0, 0.0, 0.0)

    @classmethod
    def read(cls, data: Any, where: str) -> MovingMass:
        """Return the moving mass that a model file states."""
        fields = Fields(data, where, "moving_mass", ("mass", "axis"))
        axis = fields.unit("axis") if fields.has("axis") else np.array([1.0, 0.0, 0.0])
        return cls(fields.positive("mass"), tuple(axis.tolist()))  # type: ignore[arg-type]

    def to_dict(self) -> dict[str, Any]:
        """Return the entry of a model file."""
        return {"mass": self.mass, "axis": list(self.axis)}


def check_drives(vehicle: Any, where: str) -> None:
    """Refuse what does not go together.

    Raises:
        ModelError: thrusters together with a ballast, a moving mass or a measured attitude.
    """
    glides = vehicle.ballast is not None or vehicle.moving_mass is not None
    if vehicle.thrusters and (glides or vehicle.reduced.attitude == "measured"):
        what = "reduced: {attitude: measured}" if not glides else "ballast and moving_mass"
        raise ModelError(
            f"{where}: {what} cannot be given together with thrusters: leave them out, and log their force as "
            "tau_X ... tau_N"
        )
