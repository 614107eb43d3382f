"""Effects that the catalogue does not have, for asking whether a diagnosis knows what it does not know.

They act in the plants `numpy` and `mujoco`. No name of the catalogue is right for any of them; what can be right is
the degree of freedom that they push most (`axis`).
"""

from auvnn.catalogue import Catalogue

STRANGERS = Catalogue(
    "stranger",
    {
        "stranger_heading_force": "auvnn.plants.strangers.heading_force:HeadingForce",
        "stranger_square_wave": "auvnn.plants.strangers.square_wave:SquareWave",
        "stranger_layers": "auvnn.plants.strangers.layers:Layers",
        "stranger_turn_roll": "auvnn.plants.strangers.turn_roll:TurnRoll",
        "stranger_loose_mass": "auvnn.plants.strangers.loose_mass:LooseMass",
        "stranger_place_moment": "auvnn.plants.strangers.place_moment:PlaceMoment",
        "stranger_reverse_heave": "auvnn.plants.strangers.reverse_heave:ReverseHeave",
        "stranger_pitch_thrust": "auvnn.plants.strangers.pitch_thrust:PitchThrust",
    },
    "auvnn.strangers",
)


def names() -> list[str]:
    """Return the strangers' names, as `hidden=` takes them."""
    return STRANGERS.names()


__all__ = ["STRANGERS", "names"]
