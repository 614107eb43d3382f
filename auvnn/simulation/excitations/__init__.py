"""The catalogue of excitations: what the vehicle is made to do. A new one is one file and one line here."""

from auvnn.catalogue import Catalogue
from auvnn.simulation.excitations.base import Controller, Excitation, Plan, make_excitation

EXCITATIONS = Catalogue(
    "excitation",
    {
        "paper": "auvnn.simulation.excitations.paper:Paper",
        "multisine": "auvnn.simulation.excitations.multisine:Multisine",
        "survey": "auvnn.simulation.excitations.survey:Survey",
        "coast_down": "auvnn.simulation.excitations.coast_down:CoastDown",
        "pulses": "auvnn.simulation.excitations.pulses:Pulses",
        "oblique": "auvnn.simulation.excitations.oblique:Oblique",
        "chirp": "auvnn.simulation.excitations.chirp:Chirp",
        "rotation": "auvnn.simulation.excitations.rotation:Rotation",
        "reciprocal": "auvnn.simulation.excitations.reciprocal:Reciprocal",
        "dives": "auvnn.simulation.excitations.dives:Dives",
    },
    "auvnn.excitations",
)

__all__ = ["EXCITATIONS", "Controller", "Excitation", "Plan", "make_excitation"]
