"""Physics, damping and effects as one `nn.Module`, its free running, and its files."""

from auvnn.models.grey_box import GreyBox, Prepared
from auvnn.models.inputs import Inputs
from auvnn.models.loading import from_vehicle, load, remove
from auvnn.models.rollout import rollout
from auvnn.models.saving import save
from auvnn.models.taking import as_log, as_model
from auvnn.models.trajectory import Divergence, Trajectory

__all__ = [
    "Divergence",
    "GreyBox",
    "Inputs",
    "Prepared",
    "Trajectory",
    "as_log",
    "as_model",
    "from_vehicle",
    "load",
    "remove",
    "rollout",
    "save",
]
