"""The paper's model structures, one file each: what is known, and where the networks sit.

Every member of the catalogue is a function of a vehicle that returns a `GreyBox`, so that all of them are called,
run free, trained, saved and loaded the same way:

    model = build_structure("parallel", vehicle, hidden=15)
    nu_dot = model(eta, nu, command)
    trajectory = model.rollout(eta0, nu0, commands, times)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from auvnn.catalogue import Catalogue

if TYPE_CHECKING:
    from auvnn.models.grey_box import GreyBox
    from auvnn.vehicle import Vehicle

STRUCTURES = Catalogue(
    "model structure",
    {
        "known": "auvnn.models.structures.known:known",
        "classical": "auvnn.models.structures.classical:classical",
        "parallel": "auvnn.models.structures.parallel:parallel",
        "separate": "auvnn.models.structures.separate:separate",
        "damping": "auvnn.models.structures.damping:damping",
    },
    "auvnn.structures",
)


def build_structure(name: str, vehicle: Vehicle, **options: Any) -> GreyBox:
    """Return an untrained model of a vehicle in one of the paper's structures.

    Args:
        name: `known` (eq. 13), `classical` (eq. 7), `parallel` (figure 2, eq. 10), `separate` (figure 3, eq. 11)
            or `damping` (figure 4, eq. 15).
        vehicle: what is known; its damping counts as unknown and is left out.
        **options: of the structure, and `effects`, `actuation` and `seed` for all of them.

    Raises:
        ConfigError: an unknown structure or option, or a value out of range.
    """
    import inspect

    from auvnn.catalogue import unknown_name
    from auvnn.errors import ConfigError

    builder = STRUCTURES.get(name)
    known = [p for p in inspect.signature(builder).parameters if p != "vehicle"]
    for option in options:
        if option not in known:
            raise ConfigError(unknown_name(f"option of model structure '{name}'", option, known))
    return builder(vehicle, **options)


__all__ = ["STRUCTURES", "build_structure"]
