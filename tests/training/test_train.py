"""train(): what the subnetworks are asked for, what they are worth on held-out data, what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.metrics.derivative import choose_derivative
from auvnn.metrics.one_step import one_step, scores
from auvnn.models import GreyBox, load
from auvnn.training.train import targets, train
from tests.small_logs import make_log, small_vehicle

VEHICLE = small_vehicle()
NAMES = ("du", "dv", "dw", "dp", "dq", "dr")


def damping(nu):
    """Return the true damping by plain matrix products, (N, 6)."""
    return nu @ VEHICLE.linear_damping.T + (np.abs(nu) * nu) @ VEHICLE.quadratic_damping.T


@pytest.fixture(scope="module")
def truth():
    return GreyBox(VEHICLE)


@pytest.fixture(scope="module")
def bare():
    """The same vehicle for one who knows nothing of its damping."""
    return GreyBox(replace(VEHICLE, linear_damping=None, quadratic_damping=None))


@pytest.fixture(scope="module")
def measured(truth):
    """Four runs with accelerations, without noise."""
    return make_log(truth, runs=4, duration=15.0, accelerations=True)


@pytest.fixture(scope="module")
def trained(bare, measured):
    told: list[str] = []
    return train(bare, measured.select([0, 1, 2]), test=measured.select([3]), progress=told.append), told


def test_targets_are_the_true_damping_where_accelerations_were_measured(bare, measured):
    nu, target, run = targets(bare, measured, choose_derivative(measured))
    np.testing.assert_array_equal(nu, np.concatenate([r.nu for r in measured.runs]))
    np.testing.assert_allclose(target, damping(nu), atol=1e-10)
    np.testing.assert_array_equal(np.unique(run, return_counts=True), [[0, 1, 2, 3], [151] * 4])


@pytest.mark.parametrize("uneven", [0.0, 0.4])
def test_targets_are_the_true_damping_where_accelerations_are_estimated(truth, bare, uneven):
    """The filter's own effect is left on both sides, so that it makes hardly any difference."""
    log = make_log(truth, runs=1, duration=15.0, rate=20.0, uneven=uneven)
    nu, target, _ = targets(bare, log, choose_derivative(log))
    left = np.sqrt(np.mean((target - damping(nu)) ** 2, 0)) / target.std(0)
    assert (left < 0.025).all()
    # Against the velocities as they were measured the same targets are visibly off.
    assert np.sqrt(np.mean((target - damping(log.runs[0].nu)) ** 2, 0) / target.var(0))[3] > 1.5 * left[3]


def test_targets_are_against_the_water_and_on_top_of_what_the_model_states(truth):
    current = {"ocean_current": {"v_north": 0.3, "v_east": -0.2}}
    log = make_log(truth.with_effects(current), runs=1, duration=8.0, accelerations=True)
    half = replace(VEHICLE, linear_damping=VEHICLE.linear_damping / 2, quadratic_damping=None)
    nu, target, _ = targets(GreyBox(half).with_effects(current), log, choose_derivative(log))
    run = log.runs[0]
    water = Rotation.from_quat(run.quaternion, scalar_first=True).inv().apply([0.3, -0.2, 0.0])
    np.testing.assert_allclose(nu, run.nu - np.pad(water, ((0, 0), (0, 3))), atol=1e-12)
    np.testing.assert_allclose(target, damping(nu) - nu @ half.linear_damping.T, atol=1e-9)


def test_missing_samples_have_no_target(bare, measured):
    run = measured.runs[0]
    nu = run.nu.copy()
    nu[40, 1] = np.nan
    log = Log.from_runs([Run(0, run.t, run.quaternion, nu, nu_dot=run.nu_dot, thrusters=run.thrusters)])
    found, target, _ = targets(bare, log, choose_derivative(log))
    assert np.isnan(found[40]).all() and np.isnan(target[40]).all()
    assert np.isfinite(np.delete(target, 40, 0)).all() and np.isfinite(np.delete(found, 40, 0)).all()


def test_the_trained_model_predicts_the_held_out_run(trained, bare, measured):
    found, told = trained
    test = measured.select([3])
    how = choose_derivative(test)
    before, after = (scores(one_step(m, test, how)) for m in (bare, found.model))
    for name in NAMES:
        assert after[name]["r2"] > 0.99 and after[name]["r2"] > before[name]["r2"]
        assert found.metrics[f"held_out_r2_{name}_before"] == before[name]["r2"]
        assert found.metrics[f"held_out_r2_{name}_after"] == after[name]["r2"]
    assert min(before[n]["r2"] for n in NAMES) < 0.9
    assert not any("got worse" in w for w in found.warnings)
    assert told and told[0].startswith("iteration ")


def test_the_subnetworks_give_the_true_damping_over_the_velocities_that_were_seen(trained, measured):
    found, _ = trained
    nu = measured.runs[3].nu
    with torch.no_grad():
        learned = found.model.damping(torch.tensor(nu)).numpy()
    for k in range(6):
        seen = np.abs(nu[:, k]) < 0.9 * max(np.abs(r.nu[:, k]).max() for r in measured.runs[:3])
        gap = (learned - damping(nu))[seen, k]
        assert np.sqrt(np.mean(gap**2)) < 0.1 * damping(nu)[:, k].std()


def test_the_answer_is_plain_and_says_what_was_done(trained, measured):
    found, _ = trained
    answer = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert answer["schema"] == "auvnn/training/1" and answer["model"] == "small" and answer["seed"] == 0
    assert answer["derivative"]["method"] == "measured" and "is held out" in answer["derivative"]["held_out"]
    assert answer["damping"]["form"] == "mlp" and answer["stopped"]
    assert all(isinstance(v, (int, float)) or v is None for v in answer["metrics"].values())
    history = answer["history"]
    assert len(history["iteration"]) == len(history["train"]) == len(history["held_out"]) > 3
    assert history["train"][-1] < 0.1 * history["train"][0]
    for k, curve in enumerate(found.surfaces):
        assert curve["low"] == pytest.approx(min(r.nu[:, k].min() for r in measured.runs[:2]), rel=0.5)
        assert len(curve["nu"]) == len(curve["learned"]) == 121


def test_the_model_that_was_given_is_not_changed_and_the_new_one_can_be_saved(trained, bare, tmp_path):
    found, _ = trained
    assert bare.damping is None
    again = load(found.model.save(tmp_path / "trained"))
    nu = torch.randn(20, 6, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    with torch.no_grad():
        torch.testing.assert_close(again.damping(nu), found.model.damping(nu))


def test_what_is_held_out_must_not_have_been_seen(bare, measured):
    with pytest.raises(InputError, match=r"shares .* samples with the log"):
        train(bare, measured, test=measured.select([2]))


def test_without_a_test_log_the_last_run_is_held_out(bare, measured):
    short = {"scheme": "levenberg_marquardt", "max_iterations": 2}
    found = train(bare, measured, short)
    assert found.derivative["held_out"].startswith("run 3, the last of")
    alone = train(bare, measured.select([3]), short)
    assert alone.derivative["held_out"].startswith("the last 30 % of the single run")
    assert found.metrics["iterations"] <= 2


def test_options_reach_the_scheme_and_the_subnetworks_and_wrong_ones_are_refused(bare, measured):
    log = measured.select([0, 1, 2])
    found = train(
        bare, log, {"scheme": "levenberg_marquardt", "max_iterations": 2}, {"form": "polynomial"}, seed=3
    )
    assert found.damping["form"] == "polynomial" and found.seed == 3
    assert found.scheme["scheme"] == "levenberg_marquardt"
    with pytest.raises(ConfigError, match="levenberg_marquart"):
        train(bare, log, "levenberg_marquart")
    with pytest.raises(ConfigError, match="polynomal"):
        train(bare, log, damping="polynomal")
    with pytest.raises(ConfigError, match="derivative option"):
        train(bare, log, derivative={"width": 3})


def test_a_polynomial_of_the_true_law_is_found_to_the_last_digits(bare, measured):
    found = train(bare, measured.select([0, 1, 2]), damping="polynomial", test=measured.select([3]))
    assert all(found.metrics[f"held_out_r2_{n}_after"] > 1 - 1e-9 for n in NAMES)


def test_a_training_that_was_killed_ends_where_an_unbroken_one_does(bare, measured, trained, tmp_path):
    log, test, whole = measured.select([0, 1, 2]), measured.select([3]), trained[0]

    def killed(words: str) -> None:
        if words.startswith("iteration 30"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(bare, log, test=test, checkpoint=tmp_path / "kept", progress=killed)
    again = train(bare, log, test=test, checkpoint=tmp_path / "kept", resume=True)
    assert whole.metrics["iterations"] == again.metrics["iterations"] > 30
    for a, b in zip(whole.model.damping.parameters(), again.model.damping.parameters(), strict=True):
        assert torch.equal(a, b)
    with pytest.raises((ConfigError, InputError)):
        train(bare, log, test=test, checkpoint=tmp_path / "kept")
    with pytest.raises(ConfigError):
        train(bare, measured.select([0, 1]), test=test, checkpoint=tmp_path / "kept", resume=True)
