"""Several networks for the uncertain parts, M^-1, C + D and g: figure 3 and equation 11 of the paper."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any, cast

import torch
from torch import Tensor, nn

from auvnn.effects import Effect, Moment
from auvnn.errors import ConfigError
from auvnn.models.equations_of_motion import Prepared
from auvnn.models.structures.base import Structure
from auvnn.models.structures.damping import velocity_features
from auvnn.models.structures.networks import Networks
from auvnn.physics.coriolis import coriolis_force
from auvnn.vehicle import Vehicle

STATES = ("known", "learned")
_VELOCITY_TERMS = ("Coriolis", "linear damping", "quadratic damping", "damping elements")


class InverseInertia(nn.Module):
    """M^-1 = L L', L lower triangular with a positive diagonal: symmetric and positive definite whatever is learned.

    These are the "known parameter features" of which the paper's section 4 says that use can be made; M^-1 does
    not depend on the state, so that 21 numbers are all that a network for it could learn.

    Args:
        start: matrix to start from (6, 6), symmetric and positive definite.
    """

    start: Tensor

    def __init__(self, start: Tensor) -> None:
        """Start at the given matrix exactly."""
        super().__init__()
        self.register_buffer("start", torch.linalg.cholesky(start).clone())
        self.below = nn.Parameter(torch.zeros(15, dtype=torch.float64))
        self.diagonal = nn.Parameter(torch.zeros(6, dtype=torch.float64))

    def forward(self) -> Tensor:
        """Return M^-1 (6, 6)."""
        rows, columns = torch.tril_indices(6, 6, -1)
        change = torch.zeros_like(self.start).index_put((rows, columns), self.below)
        # L = L_0 (strictly lower + diag(exp)): the numbers are pure ones, whatever the units of M.
        factor = self.start @ (change + torch.diag(torch.exp(self.diagonal)))
        return factor @ factor.mT


class Separate(Structure):
    """nu_dot = M^-1 [tau - (C + D)(nu) nu - g(eta)], each of the three parts known or learned.

    Learned, a part keeps what section 3 of the paper calls calculable: M^-1 starts at the rigid body's M_RB^-1 (the
    added mass is unknown), of C + D the rigid body's C_RB(nu) nu stays and networks give the rest, and of g nothing
    stays. Known, a part is as the vehicle's file says, its damping too.

    Args:
        vehicle: what is known.
        effects: named effects in addition to it.
        actuation: "thrusters" or "wrench".
        seed: of the initial weights.
        inertia: "known" or "learned" (NN_1; 21 numbers).
        damping: "known" or "learned" (NN_2 = C + D; six 12-h-1 networks of [nu, |nu|]).
        restoring: "known" or "learned" (NN_3 = g; six 3-h-1 networks of the direction of gravity in body axes).
        hidden: tanh units of each network.
        shared: one network with six outputs in the place of six.

    Raises:
        ConfigError: an option is unknown or out of range.
    """

    structure = "separate"

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Iterable[Effect] = (),
        actuation: str | None = None,
        seed: int = 0,
        *,
        inertia: str = "known",
        damping: str = "learned",
        restoring: str = "known",
        hidden: int = 5,
        shared: bool = False,
    ) -> None:
        """Make the networks that are asked for."""
        super().__init__(vehicle, effects, actuation)
        for name, state in (("inertia", inertia), ("damping", damping), ("restoring", restoring)):
            if state not in STATES:
                raise ConfigError(f"structure option '{name}' is {state!r}: choose known or learned")
        self._options = {"inertia": inertia, "damping": damping, "restoring": restoring, "hidden": hidden}
        self._options["shared"] = shared
        if inertia == "learned":
            rigid = super().prepare(None).rigid
            self.learned["inverse_inertia"] = InverseInertia(torch.linalg.inv(rigid))
        if damping == "learned":
            self.learned["velocity"] = Networks(12, 6, hidden=hidden, shared=shared, seed=seed)
        if restoring == "learned":
            self.learned["gravity"] = Networks(3, 6, hidden=hidden, shared=shared, seed=seed + 1)

    def structure_options(self) -> dict[str, Any]:
        """Return the options that build this structure again."""
        return dict(self._options)

    def prepare(self, moment: Moment | None = None) -> Prepared:
        """Work out the matrices, the learned M^-1 in the place of the known one."""
        prepared = super().prepare(moment)
        if "inverse_inertia" not in self.learned:
            return prepared
        return replace(prepared, inverse=cast(InverseInertia, self.learned["inverse_inertia"])())

    def _with_learned(
        self, terms: dict[str, Tensor], prepared: Prepared, nu: Tensor, rotation: Tensor
    ) -> dict[str, Tensor]:
        if "velocity" in self.learned:
            terms = {name: term for name, term in terms.items() if name not in _VELOCITY_TERMS}
            terms["Coriolis"] = -coriolis_force(prepared.rigid, nu)
            terms["network of C + D"] = -self.learned["velocity"](velocity_features(nu))
        if "gravity" in self.learned:
            terms = {**terms, "restoring": -self.learned["gravity"](rotation[..., 2, :])}
        return terms


separate = Separate
