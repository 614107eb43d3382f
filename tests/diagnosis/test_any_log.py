"""Whatever the log and the model, a diagnosis ends with an answer or with a refusal of one line, in bounded time."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.effects import EFFECTS
from auvnn.errors import AuvnnError
from auvnn.logs import Log, Run
from auvnn.models import GreyBox, load
from tests.small_logs import make_log, sines, small_vehicle

VERDICTS = ("named", "ambiguous", "partial", "unknown", "adequate")
SECONDS = 120.0


def wild(random, spread):
    """Factors about one, some of them far off."""
    return np.exp(spread * random.normal(size=6))


def some_model(random):
    """A model: the small vehicle, with coefficients as they are or far off, or a vehicle that is unstable."""
    kind = random.integers(5)
    if kind == 0:
        return load("remus100")
    if kind == 1:
        return GreyBox(small_vehicle(0.1, center_of_gravity=[0.0, 0.0, -0.04]))
    spread = (0.0, 0.7, 2.0)[kind - 2]
    drag = {
        "linear_damping": (np.array([25.0, 35.0, 40.0, 4.0, 5.0, 5.0]) * wild(random, spread)).tolist(),
        "quadratic_damping": (np.array([40.0, 60.0, 80.0, 4.0, 5.0, 6.0]) * wild(random, spread)).tolist(),
        "added_mass": (np.array([20.0, 40.0, 50.0, 1.0, 2.0, 2.0]) * wild(random, spread)).tolist(),
    }
    return GreyBox(small_vehicle(float(random.choice([0.0, 0.1, 0.5])), **drag))


def nonsense(random, model, runs, samples, rate):
    """Runs of a motion that no vehicle makes, with commands that have nothing to do with it."""
    made, located = [], random.random() < 0.7
    for number in range(runs):
        t = np.arange(samples) / rate
        size = float(random.choice([0.01, 1.0, 5.0]))
        nu = size * np.cumsum(random.normal(size=(samples, 6)), axis=0) / np.sqrt(samples)
        quaternion = np.concatenate(
            [np.ones((samples, 1)), 0.3 * sines(t, 3, int(random.integers(1 << 30)))], axis=1
        )
        quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
        command = np.clip(random.normal(size=(samples, model.actuators.size)), -1, 1)
        fins = len(model.vehicle.fins)
        made.append(
            Run(
                number,
                t,
                quaternion,
                nu,
                position=np.cumsum(random.normal(size=(samples, 3)), axis=0) if located else None,
                fins=0.2 * random.normal(size=(samples, fins)) if fins else None,
                thrusters=command,
            )
        )
    return Log.from_runs(made, "nonsense")


def spoilt(random, log):
    """The log with samples missing, values far off, and stretches that stand still."""
    runs = []
    for run in log.runs:
        nu = run.nu.copy()
        if random.random() < 0.5:
            nu[random.random(len(nu)) < 0.05] = np.nan
        if random.random() < 0.5:
            nu[random.integers(len(nu)), random.integers(6)] += float(random.choice([3.0, 1e3, 1e8]))
        if random.random() < 0.3:
            at = int(random.integers(len(nu)))
            nu[at : at + 30] = nu[at]
        runs.append(replace(run, nu=nu))
    return Log.from_runs(runs, log.name)


def some_case(seed):
    random = np.random.default_rng([seed, 17])
    model = some_model(random)
    runs, rate = int(random.choice([1, 1, 2, 4])), float(random.choice([5.0, 10.0, 20.0]))
    samples = int(random.choice([60, 200, 400]))
    names = EFFECTS.names()
    asked = (
        None
        if random.random() < 0.1
        else list(random.choice(names, size=int(random.integers(2, 8)), replace=False))
    )
    truth = GreyBox(small_vehicle()) if model.vehicle.name == "small" and random.random() < 0.7 else None
    if truth is None:
        log = nonsense(random, model, runs, samples, rate)
    else:
        size, noise = float(random.choice([0.2, 1.0])), float(random.choice([0.0, 1.0, 10.0]))
        log = make_log(
            truth, runs=runs, duration=samples / rate, rate=rate, noise=noise, seed=seed, size=size,
            accelerations=bool(random.random() < 0.3),
        )  # fmt: skip
    return model, spoilt(random, log) if random.random() < 0.6 else log, asked


def ends_well(seed):
    """Return the verdict, or the refusal; raise where it is anything else."""
    began = time.process_time()
    try:
        model, log, asked = some_case(seed)
        found = diagnose(model, log, asked, whiteness=seed % 2 == 0, force=True)
    except AuvnnError as refusal:
        assert str(refusal) and "\n" not in str(refusal)
        told = f"refused: {refusal}"
    else:
        assert found.verdict in VERDICTS
        found.to_dict()
        assert found.story
        told = found.verdict
    assert time.process_time() - began < SECONDS, f"seed {seed} took {time.process_time() - began:.0f} s"
    return told


# Some of each kind that take a few seconds each; those of a minute are among the three hundred.
@pytest.mark.parametrize("seed", [1, 6, 9, 11, 12, 16, 36, 52])
def test_a_diagnosis_of_anything_ends_well(seed):
    ends_well(seed)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(303))
def test_three_hundred_diagnoses_of_anything_end_well(seed):
    ends_well(seed)
