"""The catalogue of plants: what makes the motion of a simulated log. A new one is one file and one line here."""

from auvnn.catalogue import Catalogue
from auvnn.plants.base import Motion, Plant, PlantTask

PLANTS = Catalogue(
    "plant",
    {
        "own": "auvnn.plants.own:OwnPlant",
        "numpy": "auvnn.plants.independent:NumpyPlant",
        "mujoco": "auvnn.plants.mujoco_engine:MujocoPlant",
    },
    "auvnn.plants",
)

__all__ = ["PLANTS", "Motion", "Plant", "PlantTask"]
