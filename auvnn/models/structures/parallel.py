"""One network in parallel to the whole model: figure 2 and equation 10 of the paper."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import torch
from torch import Tensor

from auvnn.effects import Effect
from auvnn.models.equations_of_motion import Prepared
from auvnn.models.structures.base import Structure, without_damping
from auvnn.models.structures.networks import Networks
from auvnn.physics.products import matvec
from auvnn.vehicle import Vehicle


class Parallel(Structure):
    """nu_dot = Phi_M(nu, tau, eta) + Phi_hat(nu, tau, eta), Phi_M the known model and Phi_hat one network.

    Phi_hat sees [nu, |nu|], the wrench, and the direction of gravity in the body's axes (the third row of the
    rotation matrix): all of eta that a vehicle in deep water can notice. |nu| is not in figure 2; without it the
    comparison with the damping networks, which have it, would not be fair. With 15 units it has 426 weights,
    exactly as many as the paper's six damping networks.

    Args:
        vehicle: what is known; its damping is left out.
        effects: named effects in addition to it.
        actuation: "thrusters" or "wrench".
        seed: of the initial weights.
        hidden: tanh units.
    """

    structure = "parallel"

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Iterable[Effect] = (),
        actuation: str | None = None,
        seed: int = 0,
        *,
        hidden: int = 15,
    ) -> None:
        """Make the network; untrained it adds nothing."""
        super().__init__(without_damping(vehicle), effects, actuation)
        self.learned["parallel"] = Networks(21, 6, hidden=hidden, shared=True, seed=seed)

    def structure_options(self) -> dict[str, Any]:
        """Return the options that build this structure again."""
        return {"hidden": cast(Networks, self.learned["parallel"]).hidden}

    def features(self, nu: Tensor, wrench: Tensor, rotation: Tensor) -> Tensor:
        """Return the network's inputs (..., 21) from nu (..., 6), the wrench (..., 6) and rotation (..., 3, 3).

        Args:
            nu: velocity, m/s and rad/s, (..., 6).
            wrench: of the known equations, N and N m, (..., 6).
            rotation: body to NED, (..., 3, 3).
        """
        parts = (nu, nu.abs(), wrench, rotation[..., 2, :])
        lead = torch.broadcast_shapes(*(p.shape[:-1] for p in parts))
        return torch.cat([p.expand(*lead, p.shape[-1]) for p in parts], dim=-1)

    def _with_learned(
        self, terms: dict[str, Tensor], prepared: Prepared, nu: Tensor, rotation: Tensor
    ) -> dict[str, Tensor]:
        # The network gives an acceleration; as a wrench it goes through M^-1 with the others and comes out again.
        added = self.learned["parallel"](self.features(nu, terms["thrust"], rotation))
        return {**terms, "parallel network": matvec(prepared.total, added)}


# A class is a function of a vehicle too; the catalogue's members are all called the same way.
parallel = Parallel
