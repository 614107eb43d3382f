"""A world's laws as numbers that a plant obeys: drawn exponents and errors, and a force that wanders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.plants import Motion, Plant, PlantTask
from auvnn.plants.independent.fins import Fins
from auvnn.plants.independent.sizes import usual_speeds
from auvnn.plants.independent.thrust import Actuators
from auvnn.plants.laws import Laws, Wander
from auvnn.simulation.worlds.world import World
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]

# Longest distance between knots of a force that wanders, s; a tenth of the shortest correlation time is as long.
SPACING = 0.025


def drawn_laws(world: World, vehicle: Vehicle, actuation: str, generator: np.random.Generator) -> Laws:
    """Return a world's laws, but for the force that wanders.

    Args:
        world: with the ranges.
        vehicle: plain numbers.
        actuation: "thrusters" or "wrench".
        generator: draws within the ranges.
    """
    shape, conventions = world.shape, world.conventions
    # Drawn whether they are needed or not: a world's draws must not hang on each other.
    place, count = generator.uniform(size=6), len(vehicle.thrusters) if actuation == "thrusters" else 6
    phase = generator.uniform(0.0, 2.0 * np.pi, count)
    low, high = shape.exponent
    speed = usual_speeds(vehicle)
    return Laws(
        exponent=None if low == high == 2.0 else low + (high - low) * place,
        speed=speed,
        thrust=shape.thrust,
        phase=phase,
        separation=shape.separation,
        added_coriolis=conventions.added_coriolis,
        relative=conventions.relative,
    )


def commanded_wrench(vehicle: Vehicle, actuation: str, motion: Motion) -> Array:
    """Return the wrench that the commands of a motion stand for by the stated numbers, fins included, (R, T, 6).

    Args:
        vehicle: plain numbers.
        actuation: "thrusters" or "wrench".
        motion: of R runs and T rows.
    """
    shape = motion.command.shape[:2]
    actuators = Actuators(vehicle, actuation, {})
    thrust = actuators.settled(motion.command.reshape(-1, motion.command.shape[-1]))
    wrench = np.concatenate([thrust @ actuators.forces.T, thrust @ actuators.turns.T], axis=-1)
    if vehicle.fins and motion.fins is not None:
        nu = motion.nu.reshape(-1, 6)
        angles = motion.fins.reshape(-1, motion.fins.shape[-1])
        wrench = wrench + np.concatenate(Fins(vehicle).wrench(nu[:, :3], nu[:, 3:], angles), axis=-1)
    return wrench.reshape(*shape, 6)


def ornstein_uhlenbeck(
    rms: Array, correlation: Array, spacing: float, count: int, generators: Sequence[np.random.Generator]
) -> Wander:
    """Return stationary Ornstein-Uhlenbeck wrenches, exact at the knots: x' = a x + sqrt(1 - a2) rms e, a = exp(-h/T).

    Args:
        rms: N and N m, (6,).
        correlation: times T, s, (6,).
        spacing: h, s.
        count: of knots.
        generators: one per run.
    """
    from scipy.signal import lfilter

    a = np.exp(-spacing / correlation)
    out = []
    for generator in generators:
        shocks = generator.standard_normal((count, 6))
        shocks[1:] *= np.sqrt(1.0 - a**2)
        columns = [lfilter([1.0], [1.0, -a[i]], shocks[:, i]) for i in range(6)]
        out.append(rms * np.stack(columns, axis=-1))
    return Wander(spacing, np.stack(out))


def disturbed(
    world: World,
    plant: Plant,
    task: PlantTask,
    generator: np.random.Generator,
    generators: Sequence[np.random.Generator],
) -> tuple[PlantTask, dict[str, Any]]:
    """Return the task with a force that wanders, and what was drawn of it.

    Its size follows from the wrench that is commanded where nothing is hidden and nothing wanders; a degree of freedom
    that is not commanded is left alone.

    Args:
        world: how large, how slow.
        plant: that moves.
        task: without what is hidden.
        generator: of the correlation times.
        generators: of the force, one per run.
    """
    low, high = np.log(world.disturbance.correlation)
    correlation = np.exp(generator.uniform(low, high, 6))
    still = plant.move(task, lambda k, position, quaternion, nu: (position, quaternion, nu))
    wrench = commanded_wrench(task.vehicle, task.actuation, still)
    rms = world.disturbance.share * np.sqrt((wrench**2).mean((0, 1)))
    step = float(task.t[1] - task.t[0])
    spacing = step / max(1, int(np.ceil(step / SPACING - 1e-9)))
    count = round(float(task.t[-1]) / spacing) + 1
    wander = ornstein_uhlenbeck(rms, correlation, spacing, count, generators)
    told = {"rms": rms.tolist(), "correlation": correlation.tolist()}
    return replace(task, laws=replace(task.laws, wander=wander)), told
