"""Physics, damping and effects as one `nn.Module`, its free running, and its files."""

from auvnn.models.equations_of_motion import Prepared
from auvnn.models.grey_box import GreyBox
from auvnn.models.inputs import Inputs
from auvnn.models.loading import from_vehicle, load, remove
from auvnn.models.rollout import rollout
from auvnn.models.saving import save
from auvnn.models.trajectory import Divergence, Trajectory

__all__ = [
    "Divergence",
    "GreyBox",
    "Inputs",
    "Prepared",
    "Trajectory",
    "from_vehicle",
    "load",
    "remove",
    "rollout",
    "save",
]
