"""Effects that the catalogue does not have, for asking whether a diagnosis knows what it does not know.

They act in the plant `numpy` only. No name of the catalogue is right for any of them; what can be right is the degree
of freedom that they push most (`axis`).
"""

from auvnn.catalogue import Catalogue

STRANGERS = Catalogue(
    "stranger",
    {
        "stranger_heading_force": "auvnn.plants.strangers.heading_force:HeadingForce",
    },
    "auvnn.strangers",
)


def names() -> list[str]:
    """Return the strangers' names, as `hidden=` takes them."""
    return STRANGERS.names()


__all__ = ["STRANGERS", "names"]
