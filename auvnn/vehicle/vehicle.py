"""The vehicle: every number of its model file in SI units and the FRD body frame."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from auvnn.cards import Card, Shown, Text
from auvnn.vehicle.checks import rigid_body
from auvnn.vehicle.parts import DEFAULT_UNCERTAINTY, Array, DampingElement, Fin, Thruster, freeze
from auvnn.vehicle.reading import vehicle_from_dict
from auvnn.vehicle.reduced import Ballast, MovingMass, Reduced
from auvnn.vehicle.summary import summary
from auvnn.vehicle.validation import validate


@dataclass(frozen=True, eq=False, repr=False)
class Vehicle(Shown):
    """What is known of a vehicle, with nothing learned in it.

    Validated when it is made, by `Vehicle.from_dict`, `load_vehicle` or in Python: a diagonal may stand for a matrix,
    and parts may be mappings as in a model file. All arrays are float64 and read-only, all lengths from the body origin,
    all axes FRD.

    Args:
        name: what it is called.
        gravity: m/s2.
        water_density: kg/m3.
        mass: kg.
        buoyancy: N.
        length: characteristic, m.
        center_of_gravity: m, (3,).
        center_of_buoyancy: m, (3,).
        inertia: kg m2 about the centre of gravity, (3, 3).
        added_mass: M_A, positive for ordinary bodies, (6, 6).
        linear_damping: D_L, force = -(D_L nu), (6, 6), or None.
        quadratic_damping: D_Q, force_i = -sum_j D_Q[i, j] |nu_j| nu_j, (6, 6), or None.
        damping_elements: drag of parts at offset centres.
        thrusters: in the order of the log's columns.
        fins: in the order of the log's columns.
        reference_voltage: V at which the thrust limits hold, or None.
        uncertainty: relative standard deviation of each coefficient group.
        effects: effects that are part of the model, name to parameters.
        source: where the numbers come from.
        warnings: what is doubtful about the file, in words.
        reduced: which degrees of freedom the model has.
        ballast: a volume that changes, or None.
        moving_mass: a mass that is shifted, or None.

    Raises:
        ModelError: a value is not physical; one line names the field, the value and the cure.

    Example:
        ```python
        vehicle = auvnn.load("remus100").vehicle
        vehicle.mass, vehicle.added_mass.shape  # kg, (6, 6)
        ```
    """

    name: str
    gravity: float
    water_density: float
    mass: float
    buoyancy: float
    length: float
    center_of_gravity: Array
    center_of_buoyancy: Array
    inertia: Array
    added_mass: Array
    linear_damping: Array | None = None
    quadratic_damping: Array | None = None
    damping_elements: tuple[DampingElement, ...] = ()
    thrusters: tuple[Thruster, ...] = ()
    fins: tuple[Fin, ...] = ()
    reference_voltage: float | None = None
    uncertainty: dict[str, float] = field(default_factory=lambda: dict(DEFAULT_UNCERTAINTY))
    effects: dict[str, dict[str, Any]] = field(default_factory=dict)
    source: str = ""
    warnings: tuple[str, ...] = ()
    reduced: Reduced = field(default_factory=Reduced)
    ballast: Ballast | None = None
    moving_mass: MovingMass | None = None

    def __post_init__(self) -> None:
        """Check that the vehicle is physical, and make the arrays read-only."""
        validate(self)
        freeze(self, "center_of_gravity", "center_of_buoyancy", "inertia", "added_mass")
        freeze(self, "linear_damping", "quadratic_damping")

    def summary(self) -> Text:
        """Return the vehicle's numbers as a few lines for a person."""
        return summary(self)

    def card(self) -> Card:
        """Return what the vehicle is in one line; its `summary` says more."""
        drives = f"{self.n_thrusters} thrusters" if self.thrusters else "no thrusters"
        line = f"{self.mass:.4g} kg, buoyancy less weight {self.buoyancy - self.weight:+.3g} N, {drives}"
        rows = [line.split("  ", 1) for line in (part.strip() for part in self.summary().splitlines()[1:])]
        cells = [[name.strip(), *(words.strip() for words in more)] for name, *more in rows if more]
        return Card(f"Vehicle {self.name}", line, (), ("", ""), cells, ".summary() prints all")

    @classmethod
    def from_dict(
        cls, data: Mapping[str, Any], where: str = "vehicle", *, also: Iterable[str] = ()
    ) -> Vehicle:
        """Return the vehicle of a model file's mapping, validated and converted to FRD.

        Args:
            data: the keys of a model file.
            where: names the file in messages.
            also: further keys to leave alone, for those who keep more in the same file.

        Raises:
            ModelError: a key is unknown or missing, or a value is not physical; the message
                names the file, the field, the value and the cure.
        """
        return vehicle_from_dict(cls, data, where, frozenset(also))

    def to_dict(self) -> dict[str, Any]:
        """Return the vehicle as plain data with the keys of a model file; `from_dict` gives it back."""
        data: dict[str, Any] = {
            "name": self.name,
            "frame": "FRD",
            "gravity": self.gravity,
            "water_density": self.water_density,
            "mass": self.mass,
            "buoyancy": self.buoyancy,
            "length": self.length,
            "center_of_gravity": self.center_of_gravity.tolist(),
            "center_of_buoyancy": self.center_of_buoyancy.tolist(),
            "inertia": self.inertia.tolist(),
            "added_mass": self.added_mass.tolist(),
        }
        for name in ("linear_damping", "quadratic_damping"):
            matrix = getattr(self, name)
            if matrix is not None:
                data[name] = matrix.tolist()
        for name in ("damping_elements", "thrusters", "fins"):
            parts = getattr(self, name)
            if parts:
                data[name] = [part.to_dict() for part in parts]
        if self.reference_voltage is not None:
            data["reference_voltage"] = self.reference_voltage
        if self.reduced:
            data["reduced"] = self.reduced.to_dict()
        for name in ("ballast", "moving_mass"):
            if getattr(self, name) is not None:
                data[name] = getattr(self, name).to_dict()
        data["uncertainty"] = dict(self.uncertainty)
        if self.effects:
            data["effects"] = copy.deepcopy(self.effects)
        data["source"] = self.source
        return data

    def __eq__(self, other: object) -> bool:
        """Compare every number; warnings are about the file, not about the vehicle."""
        return isinstance(other, Vehicle) and self.to_dict() == other.to_dict()

    def __hash__(self) -> int:
        """Hash what identifies a vehicle at a glance."""
        return hash((self.name, self.mass, self.buoyancy, self.length))

    @property
    def weight(self) -> float:
        """Weight, N."""
        return self.mass * self.gravity

    @property
    def has_damping(self) -> bool:
        """Whether any damping is stated; where none is, it is to be learned."""
        return (
            self.linear_damping is not None
            or self.quadratic_damping is not None
            or bool(self.damping_elements)
        )

    @property
    def glides(self) -> bool:
        """Whether a log's ballast, moving mass or attitude moves it, and not forces alone."""
        driven = self.ballast is not None or self.moving_mass is not None
        return driven or self.reduced.attitude == "measured"

    @property
    def n_thrusters(self) -> int:
        """Number of thrusters."""
        return len(self.thrusters)

    @property
    def n_fins(self) -> int:
        """Number of fins."""
        return len(self.fins)

    @property
    def rigid_body(self) -> Array:
        """M_RB about the body origin, (6, 6): [m I, -m S(r); m S(r), I_g + m (r^T r I - r r^T)], r = r_g.

        Reference: Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, ch. 3.
        """
        return rigid_body(self.mass, self.inertia, self.center_of_gravity)

    @property
    def inertia_matrix(self) -> Array:
        """M = M_RB + M_A about the body origin, (6, 6)."""
        return self.rigid_body + self.added_mass
