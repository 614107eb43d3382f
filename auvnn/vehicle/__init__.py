"""One vehicle's numbers: read, converted to FRD, checked for physics, and explained when refused."""

from auvnn.vehicle.library import builtin_vehicles, load_vehicle, vehicle_path
from auvnn.vehicle.parts import DEFAULT_UNCERTAINTY, DampingElement, Fin, Thruster, ThrustTable
from auvnn.vehicle.vehicle import Vehicle

__all__ = [
    "DEFAULT_UNCERTAINTY",
    "DampingElement",
    "Fin",
    "ThrustTable",
    "Thruster",
    "Vehicle",
    "builtin_vehicles",
    "load_vehicle",
    "vehicle_path",
]
