"""What is possible but unlikely in a vehicle's numbers: most often a unit or a sign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from auvnn.vehicle.vehicle import Vehicle


def doubts(vehicle: Vehicle) -> list[str]:
    """Return one sentence for each number that is probably not what was meant."""
    found = []
    below = vehicle.center_of_buoyancy[2] - vehicle.center_of_gravity[2]
    if below > 0:
        found.append(
            f"the centre of buoyancy lies {below:g} m below the centre of gravity: the vehicle turns over; "
            "z points down in FRD"
        )
    if abs(vehicle.buoyancy / vehicle.weight - 1) > 0.1:
        found.append(
            f"buoyancy {vehicle.buoyancy:g} N and weight {vehicle.weight:g} N differ by more than 10 %: "
            "is the buoyancy given in N?"
        )
    if not 900 <= vehicle.water_density <= 1200:
        found.append(f"water_density {vehicle.water_density:g} kg/m3 is not that of water")
    if not 9.7 <= vehicle.gravity <= 9.9:
        found.append(f"gravity {vehicle.gravity:g} m/s2 is not that of the Earth's surface")
    for name, value in zip("xyz", np.sqrt(np.diag(vehicle.inertia) / vehicle.mass), strict=True):
        if not 0.01 <= value / vehicle.length <= 1.0:
            found.append(
                f"inertia about {name} means a radius of gyration of {value:.3g} m on a length of "
                f"{vehicle.length:g} m: is it given in kg m2?"
            )
    places = {
        "center_of_gravity": vehicle.center_of_gravity,
        "center_of_buoyancy": vehicle.center_of_buoyancy,
    }
    for kind in ("damping_elements", "thrusters", "fins"):
        places |= {f"{kind}[{i}]": part.position for i, part in enumerate(getattr(vehicle, kind))}
    for name, place in places.items():
        distance = float(np.linalg.norm(place))
        if distance > 2 * vehicle.length:
            found.append(
                f"{name} lies {distance:.3g} m from the origin, beyond two lengths: is it in metres?"
            )
    return found
