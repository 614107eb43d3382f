"""Physics, damping and effects as one `nn.Module`, its free running, and its files.

A `grey_box` holds the parts of a model, its `equations_of_motion` turn a state and `inputs` into an acceleration, and
`actuation` turns commands into thrust. `free_running` integrates it over time, in torch or by the `engine`, whose
`model_kernels` are known again by the model's `identity`; `linear` gives its matrices at a state. `loading` and
`saving` are its files, and `structures` are other ways of putting networks into it.
"""

from auvnn.models.equations_of_motion import Prepared
from auvnn.models.free_running.rollout import rollout
from auvnn.models.free_running.trajectory import Divergence, Trajectory
from auvnn.models.grey_box import GreyBox
from auvnn.models.inputs import Inputs
from auvnn.models.load_arguments import as_log, as_model
from auvnn.models.loading import from_vehicle, load, remove
from auvnn.models.saving import save

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
