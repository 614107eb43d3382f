"""The catalogue of excitations: what the vehicle is made to do. A new one is one file and one line here."""

from auvnn.catalogue import Catalogue
from auvnn.simulate.excitations.base import Controller, Excitation, Plan, make_excitation

EXCITATIONS = Catalogue(
    "excitation",
    {
        "paper": "auvnn.simulate.excitations.paper:Paper",
        "multisine": "auvnn.simulate.excitations.multisine:Multisine",
        "survey": "auvnn.simulate.excitations.survey:Survey",
    },
    "auvnn.excitations",
)

__all__ = ["EXCITATIONS", "Controller", "Excitation", "Plan", "make_excitation"]
