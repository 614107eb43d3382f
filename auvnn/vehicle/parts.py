"""The parts of a vehicle: displaced drag elements, thrusters and fins, as read-only numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Relative standard deviations of the coefficient groups where the file states none.
DEFAULT_UNCERTAINTY = {
    "added_mass": 0.1,
    "linear_damping": 0.2,
    "quadratic_damping": 0.2,
    "inertia": 0.05,
    "mass": 0.0,
    "buoyancy": 0.0,
    "thrust": 0.0,
    "fins": 0.0,
    "center_of_gravity": 0.0,
    "center_of_buoyancy": 0.0,
}


def frozen(values: Any) -> Array:
    """Return a read-only float64 copy of an array."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


def freeze(instance: Any, *names: str) -> None:
    """Replace the named arrays of a frozen dataclass by read-only copies; None stays None."""
    for name in names:
        value = getattr(instance, name)
        if value is not None:
            object.__setattr__(instance, name, frozen(value))


@dataclass(frozen=True, eq=False)
class DampingElement:
    """Drag of a part at an offset centre: H(r)^T R f(R^T H(r) nu), f_i(v) = d_i v_i + q_i |v_i| v_i.

    Args:
        position: centre of the element from the body origin, m, (3,).
        axes: columns are the element's axes in the body frame, a rotation, (3, 3).
        linear: d, N s/m and N m s, (6,), along and about the element's axes.
        quadratic: q, N s2/m2 and N m s2, (6,).
    """

    position: Array
    axes: Array
    linear: Array
    quadratic: Array

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze(self, "position", "axes", "linear", "quadratic")

    def to_dict(self) -> dict[str, Any]:
        """Return the element as plain data, as in a model file."""
        names = ("position", "axes", "linear", "quadratic")
        return {name: getattr(self, name).tolist() for name in names}


@dataclass(frozen=True, eq=False)
class ThrustTable:
    """Thrust in N against the command, linear between the points and held beyond the ends."""

    command: Array
    thrust: Array

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze(self, "command", "thrust")

    def to_dict(self) -> dict[str, Any]:
        """Return the table as plain data, as in a model file."""
        return {"command": self.command.tolist(), "thrust": self.thrust.tolist()}


@dataclass(frozen=True, eq=False)
class Thruster:
    """A thruster: its force on the vehicle is `direction` times the thrust of its curve.

    Args:
        position: where the force acts, m from the body origin, (3,).
        direction: unit vector of the force on the vehicle for a positive command, (3,).
        max_forward: largest thrust along `direction`, N.
        max_reverse: largest thrust against it, N, positive; zero for a one-way propeller.
        curve: "quadratic" (max * c * |c|) or a table.
        handedness: 1 or -1, the sense of the reaction torque about `direction`; 0 for none.
    """

    position: Array
    direction: Array
    max_forward: float
    max_reverse: float
    curve: Literal["quadratic"] | ThrustTable = "quadratic"
    handedness: int = 1

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze(self, "position", "direction")

    def to_dict(self) -> dict[str, Any]:
        """Return the thruster as plain data, as in a model file."""
        return {
            "position": self.position.tolist(),
            "direction": self.direction.tolist(),
            "max_forward": self.max_forward,
            "max_reverse": self.max_reverse,
            "curve": self.curve.to_dict() if isinstance(self.curve, ThrustTable) else self.curve,
            "handedness": self.handedness,
        }


@dataclass(frozen=True, eq=False)
class Fin:
    """A fin that turns about `axis` by its command, rad; its lift acts at `position`.

    Args:
        position: centre of pressure, m from the body origin, (3,).
        axis: unit vector about which a positive angle turns, (3,).
        area: plan area, m2.
        lift_slope: lift coefficient per rad, of `area`.
        stall: angle of attack at which the flow separates, rad.
    """

    position: Array
    axis: Array
    area: float
    lift_slope: float
    stall: float = 0.26

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        freeze(self, "position", "axis")

    def to_dict(self) -> dict[str, Any]:
        """Return the fin as plain data, as in a model file."""
        return {
            "position": self.position.tolist(),
            "axis": self.axis.tolist(),
            "area": self.area,
            "lift_slope": self.lift_slope,
            "stall": self.stall,
        }
