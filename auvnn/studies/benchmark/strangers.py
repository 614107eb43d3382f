"""Hidden things that no name of the catalogue stands for: where they come from, and how large they are made."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError

PLACE = "auvnn.plants.strangers"
# The only plant that can hold one, whichever plant makes the log.
PLANT = "numpy"
STEP = 1e-3


def strangers() -> Any:
    """Return the catalogue of strangers.

    Raises:
        ConfigError: the plants that can hold one are not installed.
    """
    if any(importlib.util.find_spec(name) is None for name in (PLACE.rpartition(".")[0], PLACE)):
        raise ConfigError(
            "strangers=: this installation has no plants that can hold one; leave strangers= out"
        )
    return importlib.import_module(PLACE).STRANGERS


def stranger_names(asked: Sequence[Any]) -> list[str]:
    """Return the strangers asked for, "all" being every one that there is.

    Raises:
        ConfigError: there is no such stranger.
    """
    if not asked:
        return []
    known = strangers()
    names = [n for a in asked for n in (known.names() if a == "all" else [str(a)])]
    for name in names:
        if name not in known:
            raise ConfigError(unknown_name("stranger", name, known.names()))
    return list(dict.fromkeys(names))


def sized_stranger(model: Any, name: str, size: str, *, seed: int = 0, **how: Any) -> dict[str, float]:
    """Return the strength, of random sign, at which a stranger has a stated size, as effects have theirs.

    The size is the distance from strength zero in standard errors for realistic noise, with the initial states of
    windows of free running unknown and everything else known; the windows are run on the plant that holds strangers.

    Args:
        model: nominal.
        name: of the stranger.
        size: small, medium or large.
        seed: of sign and manoeuvre.
        how: excitation, runs, duration and rate, as in `simulate`.

    Raises:
        ConfigError: the manoeuvre says nothing about it.
    """
    import torch

    from auvnn.diagnosis.hypotheses.candidates import windows_for
    from auvnn.estimation.sensitivity import Response
    from auvnn.estimation.window_normal_equations import normal_equations
    from auvnn.metrics.free_run import initial_states
    from auvnn.simulation import simulate
    from auvnn.studies.benchmark.identifiability.information import noise_sigma
    from auvnn.studies.benchmark.identifiability.plant_information import PlantOutputs, change, state_slopes
    from auvnn.studies.hidden import SIZES

    how = {**how, "noise": "realistic"}
    windows = windows_for(model, simulate(model, seed=seed, max_step=0.025, **how).log)
    outputs = PlantOutputs(PLANT, model, windows)
    states = initial_states(model, windows).numpy()
    now = outputs(states, {}, {name: {"strength": 0.0}})
    there = outputs(states, {}, {name: {"strength": STEP}})
    seen = windows.mask.unsqueeze(-1)
    response = Response(
        torch.zeros((*now.shape[:2], 18), dtype=torch.float64),
        torch.as_tensor(state_slopes(outputs, states, now, {})) * seen,
        torch.as_tensor(change(now, there)[..., None] / STEP) * seen,
    )
    sums, _, _ = normal_equations(windows, [response], noise_sigma("realistic", windows))
    information = float(sums.hessian.sum())
    if not information > 1e-18:
        raise ConfigError(
            f"{name} leaves no trace on {model.vehicle.name} under this excitation: choose another"
        )
    sign = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(103,))).choice([-1.0, 1.0])
    return {"strength": float(sign * SIZES[size] / np.sqrt(information))}


def axis_of(name: str) -> list[str]:
    """Return the degrees of freedom in which a stranger mostly acts."""
    return [str(strangers().get(name).axis)]


def said_axis(depends: Mapping[str, Mapping[str, float]]) -> str | None:
    """Return the degree of freedom of which a diagnosis says that the unknown explains most, or None."""
    explained = {axis: sum(shares.values()) for axis, shares in depends.items() if shares}
    return max(explained, key=lambda axis: explained[axis]) if explained else None
