"""The quality report says what is wrong with a log, and is silent about one that is right."""

import json

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log, check
from auvnn.logs.signals.outliers import spikes
from tests.log_samples import NAMES, make_log, make_run
from tests.logs.quality.test_kinematics import with_nu


def subjects(log: Log, level: str = "warning") -> dict[str, str]:
    return {f.where: f.what for f in log.quality().of_level(level)}


def test_a_good_log_has_no_errors_and_no_warnings() -> None:
    quality = make_log(2, noise=0.01).quality()
    assert quality.errors == []
    assert quality.warnings == []
    quality.refuse_errors()


def test_the_answer_is_plain_json_of_the_contract() -> None:
    log = make_log(2, noise=0.01)
    answer = json.loads(json.dumps(log.quality().to_dict(), allow_nan=False))
    assert next(iter(answer)) == "schema"
    assert answer["schema"] == "auvnn/quality/1"
    assert set(answer) == {
        *("schema", "log", "read", "metrics", "runs", "channels", "findings", "repairs", "kinematics"),
        "excitation",
    }
    assert answer["metrics"]["samples"] == 1600
    assert answer["metrics"]["rate_hz"] == pytest.approx(20.0)
    assert answer["metrics"]["duration_s"] == pytest.approx(2 * 39.95)
    assert all(isinstance(v, (int, float, type(None))) for v in answer["metrics"].values())
    assert answer["channels"]["u"]["unit"] == "m/s"
    assert answer["channels"]["u"]["noise_std"] == pytest.approx(0.01, rel=0.15)
    assert set(answer["kinematics"]) == set(NAMES)
    assert answer["runs"][0]["samples"] == 800
    assert check(log) is log.quality()


def test_missing_samples_are_shares() -> None:
    run = make_run()
    nu = np.array(run.nu)
    nu[:80, 1] = np.nan
    log = Log.from_runs([with_nu(run, nu)])
    assert log.quality().channels["v"].missing_share == pytest.approx(0.1)
    assert "v 10 %" in subjects(log)["missing"]
    assert log.quality().metrics["valid_share"] == pytest.approx(0.9)


def test_frozen_and_constant_channels() -> None:
    run = make_run(noise=0.01)
    nu = np.array(run.nu)
    nu[200:400, 2] = nu[200, 2]
    log = Log.from_runs([with_nu(run, nu)])
    assert "stands still" in subjects(log)["w"]
    assert log.quality().channels["w"].frozen_share == pytest.approx(0.25, abs=0.01)
    nu[:, 2] = 0.3
    log = Log.from_runs([with_nu(run, nu)])
    assert "never changes from 0.3 while u, v, p" in subjects(log)["w"]


def test_a_vehicle_at_rest_is_no_frozen_sensor() -> None:
    run = make_run(noise=0.01)
    nu = np.array(run.nu)
    nu[:200] = 0.0
    log = Log.from_runs([with_nu(run, nu)])
    assert not any("stands still" in what for what in subjects(log).values())


def test_sample_and_hold_is_named() -> None:
    run = make_run(noise=0.01)
    nu = np.array(run.nu)
    nu[:, :3] = np.repeat(nu[::4, :3], 4, axis=0)
    log = Log.from_runs([with_nu(run, nu)])
    assert "u 75 %, v 75 %, w 75 %" in subjects(log)["sampling"]


def test_spikes_are_counted_and_masked() -> None:
    run = make_run(noise=0.01)
    nu = np.array(run.nu)
    at = [50, 300, 301 + 99, 700]
    nu[at, 0] += 2.0
    log = Log.from_runs([with_nu(run, nu)])
    np.testing.assert_array_equal(np.flatnonzero(log.runs[0].outliers["u"]), at)
    assert not log.runs[0].outliers["v"].any()
    assert "u 4 (0.5 %);" in subjects(log)["spikes"]


@pytest.mark.parametrize("shape", ["step", "kink", "ramp", "held", "constant", "short", "missing"])
def test_real_motion_is_no_spike(shape: str) -> None:
    t = np.linspace(0.0, 10.0, 400)
    y = {
        "step": np.where(t > 5, 1.0, 0.0),
        "kink": np.abs(t - 5.0),
        "ramp": t,
        "held": np.repeat(np.sin(t[::4]), 4),
        "constant": np.ones(400),
        "short": np.array([0.0, 5.0, 0.0]),
        "missing": np.full(400, np.nan),
    }[shape]
    assert not spikes(y).any()


def test_gaps_and_jitter() -> None:
    run = make_run()
    t = np.array(run.t)
    t[400:] += 7.0
    log = Log.from_runs([with_nu(run, run.nu, t=t)])
    assert "1 gaps in time, the longest 7.05 s" in subjects(log)["run 1"]
    assert log.quality().runs[0]["gaps"] == 1
    rng = np.random.default_rng(0)
    log = Log.from_runs([make_run(t=np.cumsum(rng.uniform(0.02, 0.08, 800)))])
    assert "true stamps are used" in subjects(log)["run 1"]


@pytest.mark.parametrize("kind", ["thrusters", "wrench"])
def test_no_command_at_all_forbids_fitting(kind: str) -> None:
    width = 4 if kind == "thrusters" else 6
    run = make_run(**{"thrusters": None, "wrench": None, kind: np.zeros((800, width))})
    log = Log.from_runs([run])
    assert subjects(log, "error").keys() == {"excitation"}
    with pytest.raises(InputError, match="excitation"):
        log.quality().refuse_errors()


def test_resting_and_saturated_thrusters() -> None:
    thrusters = np.array(make_run().thrusters)
    thrusters[:, 1] = 0.0
    thrusters[:, 2] = np.sign(np.sin(np.arange(800.0)))
    found = [f.what for f in Log.from_runs([make_run(thrusters=thrusters)]).quality().warnings]
    assert any("neutral throughout: thruster_2" in what for what in found)
    assert any("at their limit most of the time: thruster_3" in what for what in found)


def test_directions_without_motion_are_named() -> None:
    run = make_run()
    nu = np.array(run.nu) * np.array([1, 1, 0, 0, 1, 1.0])
    nu += 1e-3 * np.random.default_rng(0).normal(size=nu.shape)
    log = Log.from_runs([with_nu(run, nu)])
    assert "heave (w), roll (p)" in subjects(log)["excitation"]
    quality = log.quality()
    assert not quality.excitation["w"].excited
    assert quality.excitation["u"].excited
    assert quality.metrics["excited_directions"] == 4
    still = Log.from_runs([with_nu(run, 1e-3 * np.random.default_rng(0).normal(size=(800, 6)))])
    assert "nothing to fit" in subjects(still, "error")["excitation"]


def test_condition_tells_whether_linear_and_quadratic_damping_can_be_parted() -> None:
    from auvnn.logs.quality.excitation import condition

    t = np.linspace(0, 20, 2000)
    one_speed = np.where(np.sin(t) > 0, 0.5, -0.5)[:, None]
    assert condition(one_speed) == np.inf
    assert condition(np.sin(t)[:, None]) < 10.0
    rng = np.random.default_rng(0)
    # Of a normal distribution, whose moments are known: c = 2 sqrt(2 / pi) / sqrt(3).
    assert condition(rng.normal(size=(100_000, 1))) == pytest.approx(4.94, rel=0.02)
    assert condition(np.zeros((100, 1))) == np.inf


def test_voltage_depth_and_attitude_that_need_a_look() -> None:
    found = subjects(
        Log.from_runs(
            [
                make_run(
                    voltage=np.linspace(16.0, 12.0, 800),
                    position=np.array(make_run().position) * np.array([1.0, 1.0, -1.0]),
                    quaternion=np.array(make_run().quaternion) @ np.eye(4)[[1, 0, 3, 2]],
                )
            ]
        )
    )
    assert "falls from 16 to 12 V" in found["voltage"]
    assert "above the surface" in found["z"]
    assert "upside down" in found["attitude"]


def test_unknown_columns_and_repairs_are_listed(tmp_path) -> None:
    run = make_run(extra={"rpm <script>": np.arange(800.0)})
    path = Log.from_runs([run]).write(tmp_path / "log.csv")
    text = path.read_text().replace("\n", "\n\n", 3)
    lines = text.split("\n")
    path.write_text("\n".join([*lines[:-100], lines[-101], *lines[-100:]]))
    path.with_name("log.csv.sha256").unlink()  # the change is meant
    quality = Log.read(path).quality()
    assert any("rpm <script>" in f.what for f in quality.of_level("info"))
    assert any("repeated time stamp" in f.what for f in quality.of_level("repair"))
    assert quality.to_dict()["repairs"][0]["count"] == 1


def test_a_log_in_which_nothing_is_measured_still_answers() -> None:
    run = make_run(nu=np.full((800, 6), np.nan), position=None, quaternion=np.full((800, 4), np.nan))
    answer = Log.from_runs([run]).quality().to_dict()
    assert json.dumps(answer, allow_nan=False)
    assert answer["channels"]["u"]["missing_share"] == 1.0
    assert answer["metrics"]["speed_max_m_s"] is None


@pytest.mark.parametrize("samples", [3, 5, 12, 40])
def test_short_logs_still_answer(samples: int) -> None:
    answer = Log.from_runs([make_run(samples)]).quality().to_dict()
    assert json.dumps(answer, allow_nan=False)
