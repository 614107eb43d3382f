"""Networks for the damping inside the known model: figure 4 and equation 15 of the paper, its own choice."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import torch
from torch import Tensor, nn

from auvnn.damping.bank import DampingBank
from auvnn.effects import Effect
from auvnn.errors import ConfigError
from auvnn.models.grey_box import GreyBox
from auvnn.models.structures.base import Structure, without_damping
from auvnn.models.structures.networks import Networks
from auvnn.vehicle import Vehicle


def velocity_features(nu: Tensor) -> Tensor:
    """Return the paper's twelve inputs [nu, |nu|] (..., 12)."""
    return torch.cat([nu, nu.abs()], dim=-1)


def damping(
    vehicle: Vehicle,
    effects: Iterable[Effect] = (),
    actuation: str | None = None,
    seed: int = 0,
    *,
    networks: str = "six",
    hidden: int | None = None,
    inputs: str = "absolute",
) -> GreyBox:
    """Return M nu_dot + C(nu) nu + d(nu) + g(eta) = tau with d by networks.

    Args:
        vehicle: what is known.
        effects: named effects in addition to it.
        actuation: "thrusters" or "wrench".
        seed: of the initial weights.
        networks: "six", one network of 71 weights for each degree of freedom as in the paper, or "one" with six
            outputs, which the paper argues against.
        hidden: tanh units; by default 5 of each of the six as in the paper, 22 of the one (424 weights, the same
            number as 6 times 71 within two).
        inputs: of the six: "absolute" for [nu, |nu|] as in the paper, "quadratic" for [nu, |nu| nu].

    Raises:
        ConfigError: an option is unknown or out of range.
    """
    if networks == "six":
        form = {"form": "mlp", "hidden": 5 if hidden is None else hidden, "inputs": inputs}
        bank = DampingBank.from_description(form, seed)
        return GreyBox(without_damping(vehicle), effects, bank, actuation)
    if networks != "one":
        raise ConfigError(f"structure option 'networks' is {networks!r}: choose six or one")
    if inputs != "absolute":
        raise ConfigError("one network with six outputs takes inputs=absolute alone")
    return OneNetwork(vehicle, effects, actuation, seed, hidden=22 if hidden is None else hidden)


class OneNetwork(Structure):
    """The damping of all six degrees of freedom by one network with six outputs.

    Args:
        vehicle: what is known; its damping is left out.
        effects: named effects in addition to it.
        actuation: "thrusters" or "wrench".
        seed: of the initial weights.
        hidden: tanh units.
    """

    structure = "damping"

    def __init__(
        self,
        vehicle: Vehicle,
        effects: Iterable[Effect] = (),
        actuation: str | None = None,
        seed: int = 0,
        *,
        hidden: int = 22,
    ) -> None:
        """Put the network in the place of the six."""
        super().__init__(without_damping(vehicle), effects, actuation)
        self.learned["damping"] = Networks(12, 6, hidden=hidden, shared=True, seed=seed)
        self.damping = cast(DampingBank, _Damping(self.learned["damping"]))

    def structure_options(self) -> dict[str, Any]:
        """Return the options that build this structure again."""
        network = cast(Networks, self.learned["damping"])
        return {"networks": "one", "hidden": network.hidden}

    def take(self, other: Structure) -> None:
        """Use the network of another model, through the same module: the two then count as one."""
        super().take(other)
        self.damping = other.damping


class _Damping(nn.Module):
    """From a velocity to the wrench against it, through a network that is owned elsewhere."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        # In a tuple, so that the weights are not registered twice.
        self.network = (network,)

    def forward(self, nu: Tensor) -> Tensor:
        return self.network[0](velocity_features(nu))
