"""The noise in made logs against the numbers that the conditions state."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

from auvnn.models import GreyBox
from auvnn.simulation import make_noise, simulate
from auvnn.simulation.noise import ACCELERATION, CHANNELS, VELOCITY
from auvnn.vehicle import load_vehicle

OPTIONS = {"runs": 4, "duration": 40.0, "rate": 20.0, "max_step": 0.05}
REALISTIC = {"nu": [0.006] * 3 + [0.003] * 3, "position": [0.05, 0.05, 0.01]}


def is_std(noise: np.ndarray, std: float) -> None:
    """Chi-square test of the variance at a level of one in 10^5, and of the mean at 4.5 standard errors."""
    n = noise.size
    low, high = chi2.ppf([5e-6, 1 - 5e-6], n)
    assert low < (noise**2).sum() / std**2 < high
    assert abs(noise.mean()) < 4.5 * std / np.sqrt(n)


@pytest.fixture(scope="module")
def model():
    return GreyBox(load_vehicle("bluerov2"))


def stacked(made, name):
    return np.stack([getattr(r, name) for r in made.log.runs])


@pytest.fixture(scope="module")
def pairs(model):
    exact = simulate(model, "paper", "none", **OPTIONS)
    return {
        "none": exact,
        **{n: simulate(model, "paper", n, **OPTIONS) for n in ("realistic", "paper")},
        "uniform": simulate(model, "paper", {"name": "paper", "amplitude": "uniform"}, **OPTIONS),
    }


def test_none_is_exact(pairs):
    runs = pairs["none"].log.runs
    assert runs[0].nu_dot is not None
    # The paper's manoeuvre is the same in every run; only noise or the battery could tell them apart.
    assert all(np.array_equal(r.nu, runs[0].nu) for r in runs[1:])


def test_realistic(pairs):
    exact, noisy = pairs["none"], pairs["realistic"]
    assert all(r.nu_dot is None for r in noisy.log.runs)
    for name, stds in REALISTIC.items():
        noise = stacked(noisy, name) - stacked(exact, name)
        for i, std in enumerate(stds):
            is_std(noise[..., i], std)
    is_std(stacked(noisy, "voltage") - stacked(exact, "voltage"), 0.02)
    turns = [
        (Rotation.from_quat(a.quaternion, scalar_first=True).inv()
         * Rotation.from_quat(b.quaternion, scalar_first=True)).as_rotvec()
        for a, b in zip(exact.log.runs, noisy.log.runs, strict=True)
    ]  # fmt: skip
    for i, std in enumerate((0.003, 0.003, 0.008)):
        is_std(np.stack(turns)[..., i], std)
    assert np.linalg.norm(stacked(noisy, "quaternion"), axis=-1) == pytest.approx(1.0, abs=1e-12)


def test_noise_is_white_and_independent_between_channels_and_runs(pairs):
    noise = stacked(pairs["realistic"], "nu") - stacked(pairs["none"], "nu")
    rows = noise.transpose(0, 2, 1).reshape(24, -1)
    bound = 4.5 / np.sqrt(rows.shape[1])
    between = np.corrcoef(rows) - np.eye(24)
    assert np.abs(between).max() < bound
    later = [np.corrcoef(r[1:], r[:-1])[0, 1] for r in rows]
    assert np.abs(later).max() < bound
    assert kstest(rows[0] / 0.006, "norm").pvalue > 1e-4


@pytest.mark.parametrize(("condition", "factor"), [("paper", 1.0), ("uniform", 1 / np.sqrt(3))])
def test_paper(pairs, condition, factor):
    exact, noisy = pairs["none"], pairs[condition]
    assert np.array_equal(stacked(noisy, "quaternion"), stacked(exact, "quaternion"))
    assert np.array_equal(stacked(noisy, "position"), stacked(exact, "position"))
    noise = stacked(noisy, "nu_dot") - stacked(exact, "nu_dot")
    for i in range(6):
        is_std(noise[..., i], factor * (0.5, 0.05)[i >= 3])
    if condition == "uniform":
        assert 0.49 < np.abs(noise[..., :3]).max() <= 0.5
    moving = stacked(exact, "nu")[:, 2:]
    share = (stacked(noisy, "nu")[:, 2:] - moving) / np.abs(moving)
    is_std(share, factor * 0.001)


def test_accelerations_can_be_asked_for_or_left_out(model):
    short = {**OPTIONS, "duration": 2.0, "runs": 1}
    assert simulate(model, "paper", "realistic", accelerations=True, **short).log.runs[0].nu_dot is not None
    assert simulate(model, "paper", "none", accelerations=False, **short).log.runs[0].nu_dot is None


def test_a_mapping_starts_from_the_named_condition():
    noise = make_noise({"name": "realistic", "standard_deviation": {"u": 0.1}})
    assert noise.standard_deviation["u"] == 0.1
    assert noise.standard_deviation["v"] == 0.006
    custom = make_noise({"standard_deviation": {"u": 0.1}, "accelerations": True})
    assert custom.accelerations and set(custom.standard_deviation) == {"u"}


def test_channels_are_those_of_the_log():
    assert VELOCITY == ("u", "v", "w", "p", "q", "r")
    assert ACCELERATION == ("du", "dv", "dw", "dp", "dq", "dr")
    assert len(CHANNELS) == len(set(CHANNELS)) == 19
