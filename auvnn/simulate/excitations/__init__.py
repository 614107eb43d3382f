"""The catalogue of excitations: what the vehicle is made to do. A new one is one file and one line here."""

from auvnn.catalogue import Catalogue
from auvnn.simulate.excitations.base import Controller, Excitation, Plan, make_excitation

EXCITATIONS = Catalogue(
    "excitation",
    {
        "paper": "auvnn.simulate.excitations.paper:Paper",
        "multisine": "auvnn.simulate.excitations.multisine:Multisine",
        "survey": "auvnn.simulate.excitations.survey:Survey",
        "coast_down": "auvnn.simulate.excitations.coast_down:CoastDown",
        "pulses": "auvnn.simulate.excitations.pulses:Pulses",
        "oblique": "auvnn.simulate.excitations.oblique:Oblique",
        "chirp": "auvnn.simulate.excitations.chirp:Chirp",
        "rotation": "auvnn.simulate.excitations.rotation:Rotation",
        "reciprocal": "auvnn.simulate.excitations.reciprocal:Reciprocal",
        "dives": "auvnn.simulate.excitations.dives:Dives",
    },
    "auvnn.excitations",
)

__all__ = ["EXCITATIONS", "Controller", "Excitation", "Plan", "make_excitation"]
