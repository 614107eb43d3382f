"""compare(): the contract's keys, the noise floor, where the error sits, and refusals."""

from __future__ import annotations

import json
import math

import numpy as np
import polars as pl
import pytest
import torch

from auvnn.comparison import compare
from auvnn.comparison.locate import UNITS, failures, locate, regimes
from auvnn.comparison.predictions import stitch
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.metrics.one_step import OneStep
from auvnn.metrics.rollouts import HORIZONS, roll, scale_of
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

AXES, NAMES = "XYZKMN", "uvwpqr"


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def noisy(model):
    """Two long runs of the model itself, with noise."""
    return make_log(model, runs=2, duration=30.0, rate=20.0, noise=1.0)


@pytest.fixture(scope="module")
def perfect(model, noisy):
    return compare(model, noisy, horizons=(0.5, "2", "full"))


@pytest.fixture(scope="module")
def heavy():
    """A log that is heavier than the model: 8 N down."""
    truth = GreyBox(small_vehicle()).with_effects({"net_buoyancy": {"force": -8.0}})
    return make_log(truth, runs=2, duration=12.0, noise=1.0)


@pytest.fixture(scope="module")
def wrong(model, heavy):
    return compare(model, heavy)


def test_the_keys_are_those_of_the_contract_and_nothing_is_not_a_number(wrong, heavy):
    text = json.dumps(wrong.to_dict(), allow_nan=False)
    found = json.loads(text)
    assert found["schema"] == "auvnn/comparison/1"
    assert {
        "schema",
        "model",
        "log",
        "samples",
        "runs",
        "derivative",
        "one_step",
        "rollout",
        "residual_wrench",
        "failures",
    } <= set(found)
    assert (found["model"], found["log"], found["samples"], found["runs"]) == (
        "small",
        heavy.name,
        heavy.samples,
        2,
    )
    assert set(found["derivative"]) == {"method", "bandwidth_hz"}
    assert list(found["one_step"]) == [f"d{n}" for n in NAMES]
    assert all(set(v) == {"rmse", "noise_floor", "r2"} for v in found["one_step"].values())
    assert list(found["rollout"]) == list(HORIZONS)
    for row in found["rollout"].values():
        assert {*NAMES, "total", "persistence", "diverged"} <= set(row)
        assert all(set(row[n]) == {"rmse", "nrmse"} for n in NAMES)
    assert list(found["residual_wrench"]) == list(AXES)
    assert all(set(v) == {"rms", "mean", "noise_floor"} for v in found["residual_wrench"].values())
    assert all(set(f) == {"channel", "where", "share"} for f in found["failures"])
    # 12 s runs bear 10 s of free running but not, say, a number for what was not there.
    assert found["rollout"]["10"]["total"] is not None


def test_a_log_too_short_for_a_horizon_has_null_there(model):
    short = compare(model, make_log(model, runs=1, duration=4.0))
    found = json.loads(json.dumps(short.to_dict(), allow_nan=False))
    assert found["rollout"]["10"]["total"] is None and found["rollout"]["10"]["u"] == {
        "rmse": None,
        "nrmse": None,
    }
    assert found["rollout"]["2"]["total"] is not None


def test_the_noise_floor_is_what_a_perfect_model_leaves(perfect):
    for axis, value in perfect.residual_wrench.items():
        assert value["rms"] == pytest.approx(value["noise_floor"], rel=0.15), axis
    for name, value in perfect.one_step.items():
        assert value["rmse"] == pytest.approx(value["noise_floor"], rel=0.15), name
    np.testing.assert_allclose(
        perfect.noise_floor, [v["noise_floor"] for v in perfect.residual_wrench.values()]
    )
    assert list(perfect.rollout) == ["0.5", "2", "full"]


def test_a_perfect_model_has_no_failures_to_speak_of(perfect, wrong):
    assert perfect.failures == []
    assert wrong.failures


def test_what_is_missing_shows_in_its_degree_of_freedom_in_plain_words(wrong):
    first = wrong.failures[0]
    assert (first["channel"], first["where"]) == ("Z", "heave, everywhere") and first["share"] > 0.8
    assert [f["share"] for f in wrong.failures] == sorted((f["share"] for f in wrong.failures), reverse=True)
    # Eight newtons down, in the body's own axes.
    assert wrong.residual_wrench["Z"]["mean"] == pytest.approx(8.0, rel=0.1)
    horizontal = [wrong.residual_wrench[a]["rms"] for a in "XY"]
    assert max(horizontal) < 0.4 * wrong.residual_wrench["Z"]["rms"]
    assert wrong.rollout["5"]["w"]["nrmse"] > 3 * wrong.rollout["5"]["u"]["nrmse"]


def test_a_place_where_the_error_gathers_is_named_with_its_edges():
    """Made by hand: surge errs only when fast, yaw everywhere alike."""
    t, random = np.arange(0, 200.0, 0.1), np.random.default_rng(0)
    nu = np.zeros((len(t), 6))
    nu[:, 0] = 0.5 + 0.5 * np.sin(0.3 * t)
    quaternion = np.tile([1.0, 0, 0, 0], (len(t), 1))
    log = Log.from_runs([Run(0, t, quaternion, nu, wrench=np.zeros((len(t), 6)))])
    wrench = random.normal(size=(len(t), 6))
    fast = nu[:, 0] > np.quantile(nu[:, 0], 5 / 6)
    wrench[:, 0] += 10.0 * fast
    wrench[:, 5] += 3.0 * np.sign(random.normal(size=len(t)))
    zero = np.zeros((len(t), 6))
    parts = [OneStep(0, t, zero, zero, wrench, np.ones(6), np.ones(6))]
    located = locate(log, parts)
    found = failures(parts, located, np.ones(6))
    whole = 100 / 6 + 9.0
    by_words = {f["where"]: f for f in found}
    assert by_words["surge, everywhere"]["share"] == pytest.approx(100 / 6 / whole, rel=0.03)
    assert by_words["yaw, everywhere"]["share"] == pytest.approx(9 / whole, rel=0.05)
    place = next(f for f in found if "speed" in f["where"])
    edge = np.quantile(nu[:, 0], 5 / 6)
    assert place["where"].startswith(f"surge, speed from {edge:.3g} to 1 m/s: 6.0 times its average")
    assert place["share"] == pytest.approx(by_words["surge, everywhere"]["share"], rel=0.02)
    assert not any(f["where"].startswith("yaw, ") and "speed" in f["where"] for f in found)
    speed = located["speed"]
    for b in range(6):
        inside = (nu[:, 0] >= speed["edges"][b]) & (nu[:, 0] < speed["edges"][b + 1] + (b == 5))
        assert speed["count"][b] == pytest.approx(inside.sum(), abs=2)
        np.testing.assert_allclose(speed["rms"][:, b], np.sqrt(np.mean(wrench[inside] ** 2, 0)), rtol=0.02)


def test_regimes_are_what_they_are_called(noisy, wrong):
    run = noisy.runs[0]
    found = regimes(run)
    assert set(found) == set(UNITS)
    tilt = np.arccos(np.cos(run.euler[:, 0]) * np.cos(run.euler[:, 1]))
    np.testing.assert_allclose(found["attitude"], tilt, atol=1e-7)
    np.testing.assert_allclose(found["speed"], np.sqrt(np.sum(run.nu[:, :3] ** 2, 1)))
    assert found["command"].max() == 1.0 and found["time"][0] == 0.0
    np.testing.assert_array_equal(found["depth"], run.position[:, 2])
    for place in wrong.regimes.values():
        assert len(place["edges"]) == place["rms"].shape[1] + 1 == len(place["count"]) + 1
        assert place["unit"] in UNITS.values() and (np.diff(place["edges"]) > 0).all()


def test_series_hold_measurements_and_free_runs_sample_by_sample(wrong, model, heavy):
    assert [s["run"] for s in wrong.series] == [0, 1]
    series, run = wrong.series[1], heavy.runs[1]
    np.testing.assert_array_equal(series["measured"], run.nu)
    rolled = roll(model, heavy, "5", scale_of(heavy))
    np.testing.assert_array_equal(series["model"], stitch(rolled, 1, run.nu))
    # Windows of five seconds, one after the other: each starts from the measured speed.
    assert np.isfinite(series["model"][:101]).all()
    for first in (0, 50):
        np.testing.assert_allclose(series["model"][first], run.nu[first], atol=1e-9)
    np.testing.assert_allclose(
        series["measured_acc"] - series["model_acc"],
        series["residual"] @ np.linalg.inv(model.prepare().total.numpy()).T,
        atol=1e-9,
    )


def test_predictions_are_written_as_a_table_of_the_same_numbers(wrong, tmp_path):
    path = wrong.write(tmp_path / "out", report=False)
    assert json.loads(path.read_text())["schema"] == "auvnn/comparison/1"
    frame = pl.read_parquet(tmp_path / "out" / "predictions.parquet")
    assert frame.height == sum(len(s["t"]) for s in wrong.series)
    second = frame.filter(pl.col("run") == 1)
    np.testing.assert_allclose(second["w"].to_numpy(), wrong.series[1]["measured"][:, 2])
    np.testing.assert_allclose(second["Z_residual"].to_numpy(), wrong.series[1]["residual"][:, 2])
    assert frame["u_model"].null_count() > 0 and frame["u_model"].is_nan().sum() == 0


def test_warnings_say_what_is_odd(model, heavy):
    bare = GreyBox(small_vehicle(linear_damping=None, quadratic_damping=None))
    assert any("no damping at all" in w for w in compare(bare, heavy, horizons=("1",)).warnings)
    loose = GreyBox(small_vehicle(linear_damping=None, quadratic_damping=None)).with_effects(
        {"constant_force": {"X": 1e5}}
    )
    found = compare(loose, heavy, horizons=("1",))
    assert f"free runs diverged: {found.rollout['1']['windows']} of horizon 1 s" in found.warnings
    run = heavy.runs[0]
    both = Log.from_runs(
        [
            Run(
                0,
                run.t,
                run.quaternion,
                run.nu,
                thrusters=run.thrusters,
                wrench=0.5
                * (
                    model.actuators.static(torch.tensor(run.thrusters)) @ model.actuators.allocation.mT
                ).numpy(),
            )
        ]
    )
    said = next(
        w for w in compare(model, both, horizons=("1",)).warnings if "their wrench over the logged one" in w
    )
    assert all(f"{axis} 2.00" in said for axis in AXES)


@pytest.mark.parametrize("horizon", ["fast", -1, 0, "nan", "inf"])
def test_horizons_that_are_no_number_of_seconds_are_refused(model, heavy, horizon):
    with pytest.raises(ConfigError, match="must be a number of seconds above zero, or full"):
        compare(model, heavy, horizons=(horizon,))


def test_a_log_driven_by_something_else_is_refused(heavy):
    with pytest.raises(InputError, match="no commands of the kind that drives the model"):
        compare(GreyBox(small_vehicle(), actuation="wrench"), heavy)


def test_horizons_are_named_by_the_shortest_number(model, heavy):
    assert list(compare(model, heavy, horizons=(0.50, 2.0, "5.0")).rollout) == ["0.5", "2", "5"]
    assert math.isfinite(compare(model, heavy, horizons=("full",)).rollout["full"]["total"])
