"""What the structures have in common: the vehicle without its damping, and a grey box with further learned parts."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, ClassVar

from torch import Tensor, nn

from auvnn.effects import Effect
from auvnn.errors import ConfigError
from auvnn.models.grey_box import GreyBox
from auvnn.models.saving import STRUCTURE
from auvnn.vehicle import Vehicle


def without_damping(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle as the paper's initial model knows it: everything but the damping."""
    return replace(vehicle, linear_damping=None, quadratic_damping=None, damping_elements=())


class Structure(GreyBox):
    """A grey box whose learned part is not the six damping subnetworks.

    A member names itself, states its options, and puts what it learns into `learned`.

    Args:
        vehicle: what is known.
        effects: named effects in addition to it, in order of action.
        actuation: "thrusters" or "wrench".
    """

    structure: ClassVar[str]

    def __init__(
        self, vehicle: Vehicle, effects: Iterable[Effect] = (), actuation: str | None = None
    ) -> None:
        """Set up the known part; the member then fills `learned`."""
        if vehicle.reduced:
            raise ConfigError(
                f"{vehicle.name} is a reduced model: these structures have all six degrees of freedom"
            )
        super().__init__(vehicle, effects, None, actuation)
        self.learned = nn.ModuleDict()

    def structure_options(self) -> dict[str, Any]:
        """Return the options that build this structure again, as plain data."""
        raise TypeError(f"model structure '{type(self).__name__}' does not state its options")

    def learned_parts(self) -> tuple[dict[str, Any], dict[str, Tensor] | None]:
        """Return the structure's name and options as an entry of a model file, and the weights of what it learns."""
        return {STRUCTURE: {"name": self.structure, **self.structure_options()}}, self.learned.state_dict()

    def _like(self, effects: Iterable[Effect], vehicle: Vehicle, actuation: str, *, shared: bool) -> GreyBox:
        """Return the same structure with other effects or other numbers, its learned parts shared or copied."""
        from auvnn.models.structures import build_structure

        made = build_structure(
            self.structure, vehicle, effects=list(effects), actuation=actuation, **self.structure_options()
        )
        assert isinstance(made, Structure)
        if shared:
            made.take(self)
        else:
            made.learned.load_state_dict(copy.deepcopy(self.learned.state_dict()))
        return made.to(self._known("mass"))

    def take(self, other: Structure) -> None:
        """Use the learned parts of another model of the same structure instead of one's own."""
        self.learned = other.learned


def learned_parameters(model: GreyBox) -> list[nn.Parameter]:
    """Return what a structure learns: its networks' weights or its damping's; effects are not among them."""
    part = model.learned if isinstance(model, Structure) else model.damping
    return [] if part is None else list(part.parameters())


def parameter_count(model: GreyBox) -> int:
    """Return how many numbers a structure learns."""
    return sum(p.numel() for p in learned_parameters(model))
