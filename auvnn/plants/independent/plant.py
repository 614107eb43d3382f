"""The plant `numpy`: separate equations in vectors, integrated by scipy between commands."""

from __future__ import annotations

from auvnn.plants.base import Look, Motion, Plant, PlantTask, drive, refuse, refuse_learned
from auvnn.plants.independent.hull import CHANGES
from auvnn.plants.independent.loads import LOADS
from auvnn.plants.independent.sensors import SENSORS
from auvnn.plants.independent.stretch import Stretch
from auvnn.plants.independent.water import WATERS

_OTHERS = ("biofouling", "payload", "flooding", "bottom_proximity", "surface_proximity", "fin_stall",
           "fin_gain", "fin_offset", "fin_drag", "fin_lag", "drag_curve", "added_mass_coriolis",
           "drag_only_current", "body_lift_stall")  # fmt: skip
_DRIVING = (
    "thruster_gain", "thruster_deadband", "thruster_lag", "propeller_lag", "thrust_overshoot", "actuation_delay",
    "thrust_asymmetry", "thrust_curve", "thrust_polynomial", "thrust_inflow_loss", "thrust_advance", "voltage_droop",
    "propeller_torque",
)  # fmt: skip
SUPPORTED = frozenset((*CHANGES, *WATERS, *LOADS, *SENSORS, *_OTHERS, *_DRIVING))


class NumpyPlant(Plant):
    """Newton's, Euler's and Kirchhoff's equations in vectors; Dormand and Prince's method of order 8.

    It shares nothing with the model but the vehicle's numbers and the meaning of the effects' parameters: neither
    code, nor formulation (rigid parts and fluid impulse instead of matrices of Coriolis terms, rotation matrices
    instead of quaternions, thrust as a continuous function of time instead of averages over steps), nor the
    solver. It knows every effect of the catalogue, and strangers that are in none.
    """

    name = "numpy"

    def refuses(self, effect: str) -> str:
        """Return why it cannot hold an effect: it has no equations for it."""
        if effect in SUPPORTED or effect.startswith("stranger_"):
            return ""
        return "it has no equations for it; use plant=own"

    def move(self, task: PlantTask, look: Look) -> Motion:
        """Run the equations."""
        refuse(self, (*task.effects, *task.strangers))
        refuse_learned(self, task)
        return drive(Stretch(task), task, look)
