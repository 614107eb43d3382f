"""Worlds: what the motion and its record have that the models of this package do not assume, as data by name."""

from auvnn.simulation.worlds.world import World, make_world

__all__ = ["World", "make_world"]
