"""What is asked of a simulation: whether it can be made, and what is reported about it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from auvnn.effects import EFFECTS
from auvnn.effects.acting_beside import in_words, needed_beside
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.plants import PlantTask
from auvnn.simulation.worlds import World
from auvnn.simulation.worlds.sensing import Sensing

COEFFICIENTS = ("exact", "drawn")


def _told(world: World, task: PlantTask, sensing: Sensing, wandering: Mapping[str, Any]) -> dict[str, Any]:
    """Return a world and what was drawn of it, as plain data."""
    laws = task.laws
    return {
        **world.to_dict(),
        "true_names": list(world.true_names),
        "drawn": {
            "exponent": None if laws.exponent is None else laws.exponent.tolist(),
            "speed": None if laws.speed is None else laws.speed.tolist(),
            "thrust_phase": None if laws.phase is None or laws.thrust == 0.0 else laws.phase.tolist(),
            "tilt": sensing.tilt.tolist(),
            "force": dict(wandering) or None,
        },
    }


def _can_be_hidden(model: GreyBox, name: str, wanted: Iterable[str]) -> None:
    needed = needed_beside(name, (*wanted, *model.effect_names))
    if needed:
        raise ConfigError(f"{name} does nothing by itself: hide {in_words(needed)} with it")
    lacking = EFFECTS.get(name).lacks(model.vehicle, model.actuation)
    if lacking:
        raise ConfigError(
            f"{name} cannot be hidden in a log of {model.vehicle.name}: its model file states no "
            f"{lacking[0]}; state it, or choose another vehicle"
        )


def _check(seed: int, runs: int, duration: float, rate: float, coefficients: str, max_step: float) -> None:
    for name, value, good in (
        ("seed", seed, isinstance(seed, (int, np.integer)) and seed >= 0),
        ("runs", runs, isinstance(runs, (int, np.integer)) and 1 <= runs <= 10_000),
        ("rate", rate, 0 < rate <= 10_000),
        ("max_step", max_step, 0 < max_step <= 1.0),
    ):
        if not good or isinstance(value, bool):
            raise ConfigError(f"{name} = {value!r} is out of range: a positive number is needed")
    if not 2.0 / rate <= duration <= 1e6 / rate:
        raise ConfigError(f"duration = {duration}: choose {2 / rate:g} to {1e6 / rate:g} s at {rate:g} Hz")
    if coefficients not in COEFFICIENTS:
        raise ConfigError(f"coefficients = {coefficients!r}: choose from {', '.join(COEFFICIENTS)}")
