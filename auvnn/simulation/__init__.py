"""Making logs: a model with effects hidden in it, an excitation, and what sensors make of the motion."""

from auvnn.simulation.excitations import EXCITATIONS, Excitation, make_excitation
from auvnn.simulation.noise import Noise, make_noise
from auvnn.simulation.simulate import Simulation, bottom_below, simulate

__all__ = [
    "EXCITATIONS",
    "Excitation",
    "Noise",
    "Simulation",
    "bottom_below",
    "make_excitation",
    "make_noise",
    "simulate",
]
