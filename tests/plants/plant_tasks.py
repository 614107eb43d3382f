"""Tasks for plants: random tilted starts and random commands, so that no term of the equations is at rest."""

import dataclasses

import numpy as np

from auvnn.effects import EFFECTS
from auvnn.models import GreyBox
from auvnn.plants import PLANTS, Motion, PlantTask
from auvnn.simulation.plant import typical_values
from auvnn.vehicle import load_vehicle


def task(vehicle="rov95", effects=None, strangers=None, actuation=None, seed=0, rows=11, rate=20.0, runs=2,
         every=2, **changes) -> PlantTask:  # fmt: skip
    """Return a task; commands change every `every` rows, and the vehicle starts close to surface and bottom."""
    known = vehicle if not isinstance(vehicle, str) else load_vehicle(vehicle)
    model = GreyBox(known, actuation=actuation).with_effects(effects or {})
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(runs, 3))
    half = 0.2 * rng.uniform(0.5, 1.0, (runs, 1))
    quaternion = np.concatenate(
        [np.cos(half), np.sin(half) * axis / np.linalg.norm(axis, axis=1, keepdims=True)], 1
    )
    place = np.concatenate([rng.normal(size=(runs, 2)), rng.uniform(0.8, 1.0, (runs, 1))], axis=1)
    nu0 = rng.normal(size=(runs, 6)) * [0.3, 0.1, 0.1, 0.1, 0.1, 0.2]
    nu0[:, 0] += 0.8 if known.fins else 0.0
    steps = -(-rows // every)
    size = model.actuators.size
    command = np.repeat(rng.uniform(-0.7, 0.7, (runs, steps, size)), every, axis=1)[:, :rows]
    if model.actuation == "wrench":
        command = command * 0.1 * known.weight * np.repeat([1.0, 0.1 * known.length], 3)
    fins = None
    if known.fins:
        fins = np.repeat(rng.uniform(-0.3, 0.3, (runs, steps, len(known.fins))), every, axis=1)[:, :rows]
    voltage = None
    if known.reference_voltage:
        voltage = known.reference_voltage * rng.uniform(0.8, 1.05, (runs, rows))
    model.bottom = 2.0
    return PlantTask(
        known, model.actuation, {str(e.name): e.values() for e in model.members}, strangers or {}, model,
        np.concatenate([place, quaternion], 1), nu0, np.arange(rows) / rate, command, fins,
        voltage=voltage, bottom=2.0, **{"max_step": 0.005, **changes},
    )  # fmt: skip


def move(plant: str, what: PlantTask) -> Motion:
    """Run a task in open loop."""
    return PLANTS.get(plant)().move(what, lambda *_: ())


def apart(one: Motion, other: Motion) -> float:
    """Return by how much reported and true motions differ, as a share of the largest motion of their kind."""
    worst = 0.0
    for f in dataclasses.fields(Motion):
        a, b = getattr(one, f.name), getattr(other, f.name)
        if a is None:
            assert b is None
            continue
        parts = ((0, 3), (3, None)) if a.shape[-1] in (6, 7) else ((0, None),)
        for low, high in parts:
            size = np.abs(a[..., low:high]).max()
            if size > 0:
                worst = max(worst, float(np.abs(a[..., low:high] - b[..., low:high]).max() / size))
    return worst


def plausible(name: str, vehicle: str, seed: int = 1) -> dict[str, float]:
    """Return random values of an effect that acts at once: a load is grasped early, a cable is taut,
    and what takes weeks takes a second."""
    known = load_vehicle(vehicle)
    actuation = "thrusters" if known.thrusters else "wrench"
    values = typical_values(EFFECTS.get(name).describe(known, actuation), np.random.default_rng(seed))
    strong = {
        "payload": {"time": 0.25},
        "tether": {"slack": 0.3},
        "biofouling": {"rate": 0.5},
        "flooding": {"rate": 1.0},
    }
    return values | strong.get(name, {})
