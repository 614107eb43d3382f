"""Training objectives: what the subnetworks are asked to be right about, one small file each."""

from __future__ import annotations

from auvnn.catalogue import Catalogue

OBJECTIVES = Catalogue(
    "training objective",
    {
        "one_step": "auvnn.training.objectives.one_step:OneStepObjective",
        "rollout": "auvnn.training.objectives.shooting:Shooting",
        "rollout_torchdiffeq": "auvnn.training.objectives.differentiable:Differentiable",
    },
    "auvnn.objectives",
)

__all__ = ["OBJECTIVES"]
