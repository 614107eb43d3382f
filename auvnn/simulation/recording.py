"""What a simulated vehicle's recorder writes down: runs of a log out of a motion, with the battery's voltage."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.logs import Run
from auvnn.models import GreyBox
from auvnn.plants import Motion
from auvnn.simulation.worlds.sensing import Sensing

Array = NDArray[np.float64]


def _battery(model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Array | None:
    """Return the voltage of a battery that falls by a tenth in ten minutes, (R, T), or None."""
    reference = model.vehicle.reference_voltage
    if reference is None:
        return None
    first = np.array([g.uniform(0.94, 1.04) for g in generators])
    return reference * (first[:, None] - 0.1 * t / 600.0)


def _runs(
    t: Array,
    motion: Motion,
    battery: Array | None,
    sensing: Sensing,
    actuation: str,
    altitude: Array | None,
    rates: bool,
    every: int,
) -> list[Run]:
    draws, thin = sensing.recorded, slice(None, None, every)
    position, quaternion, nu = (
        x[:, thin] for x in sensing.record(motion.position, motion.quaternion, motion.velocity)
    )
    rate = draws.added("du", motion.rate)[:, thin] if rates else None
    voltage = None
    if battery is not None:
        voltage = draws.added("voltage", battery[..., None])[:, thin, 0]
    command, stamps = motion.command[:, thin], sensing.stamps(t)[:, thin]
    return [
        Run(
            number=i, t=stamps[i], quaternion=quaternion[i], nu=nu[i], nu_dot=None if rate is None else rate[i],
            position=position[i], fins=None if motion.fins is None else motion.fins[i, thin],
            wrench=command[i] if actuation == "wrench" else None,
            thrusters=command[i] if actuation == "thrusters" else None,
            voltage=None if voltage is None else voltage[i],
            altitude=None if altitude is None else altitude[i, thin],
        )
        for i in range(len(nu))
    ]  # fmt: skip
