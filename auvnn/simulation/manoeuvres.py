"""The library of manoeuvres as command files: what a vehicle would be told, made for the model at hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.effects import Sensed
from auvnn.errors import AuvnnError
from auvnn.models import GreyBox
from auvnn.plants.own import closed_loop, over_ground
from auvnn.simulation.excitations import EXCITATIONS, make_excitation

Array = NDArray[np.float64]

# What may be proposed, simplest first: of equals the first is taken.
LIBRARY = ("reciprocal", "coast_down", "pulses", "oblique", "chirp", "rotation", "dives", "multisine")
STEP = 0.05


@dataclass(frozen=True)
class Manoeuvred:
    """One manoeuvre as commands.

    Attributes:
        name: of the excitation.
        t: times (T,), s.
        eta0: first position and attitude, (7,).
        nu0: first velocity over ground, (6,).
        command: thruster commands or wrench, (T, n).
        fins: fin angles, rad, (T, m), or None.
    """

    name: str
    t: Array
    eta0: Array
    nu0: Array
    command: Array
    fins: Array | None


def manoeuvres(
    model: GreyBox, duration: float, rate: float, seed: int = 0, names: Sequence[str] = LIBRARY
) -> list[Manoeuvred]:
    """Return the manoeuvres that the model's vehicle can do, each as one run of commands.

    Under a controller the commands are those that it gives the model without noise.

    Args:
        model: what the user has.
        duration: s.
        rate: commands per second.
        seed: of the random parts.
        names: of excitations.
    """
    t = np.arange(round(duration * rate) + 1) / rate
    found = []
    for k, name in enumerate(names):
        generator = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(103, k)))
        try:
            with torch.inference_mode():
                plan = make_excitation(name, EXCITATIONS).plan(model, t, [generator])
                eta0, nu0 = torch.tensor(plan.eta0), torch.tensor(plan.nu0)
                first = over_ground(model, eta0, nu0) if plan.under_way else nu0
                command, fins = plan.command, plan.fins
                if plan.controller is not None:
                    reference = model.vehicle.reference_voltage
                    voltage = (
                        None
                        if reference is None
                        else torch.full((1, len(t)), float(reference), dtype=first.dtype)
                    )
                    _, inputs = closed_loop(
                        model, plan, plan.controller, _clean, voltage, torch.tensor(t), STEP
                    )
                    command = inputs.command.numpy()
                    fins = None if inputs.fins is None else inputs.fins.numpy()
        except AuvnnError:
            # Not every vehicle can do everything.
            continue
        assert command is not None
        found.append(
            Manoeuvred(name, t, plan.eta0[0], first[0].numpy(), command[0], None if fins is None else fins[0])
        )
    return found


def _clean(_: int, sensed: Sensed) -> tuple[Array, Array, Array]:
    return sensed.position.numpy(), sensed.quaternion.numpy(), sensed.nu.numpy()
