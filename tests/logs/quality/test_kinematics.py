"""Signs, units, axes and orders found from the motion alone."""

import numpy as np
import pytest

from auvnn.errors import InputError
from auvnn.logs import Log, Run
from auvnn.logs.quality import kinematics
from tests.log_samples import NAMES, make_log, make_run


def changed(log: Log, scale: dict[str, float]) -> Log:
    factor = np.array([scale.get(name, 1.0) for name in NAMES])
    return Log.from_runs([with_nu(run, run.nu * factor) for run in log.runs])


def with_nu(run: Run, nu: np.ndarray, **changes: object) -> Run:
    values = {n: getattr(run, n) for n in ("t", "quaternion", "position", "thrusters", "voltage")}
    return Run(number=run.number, nu=nu, **(values | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_consistent_log_agrees_everywhere(noise: float) -> None:
    log = make_log(2, noise=noise)
    for name, agreement in kinematics.check_kinematics(log).items():
        assert agreement.level == "info", agreement.verdict
        assert "agrees" in agreement.verdict
        assert agreement.scale == pytest.approx(1.0, abs=0.02), name
        assert agreement.correlation > 0.99
        assert abs(agreement.lag) < 0.02
    assert log.quality().errors == []


@pytest.mark.parametrize("name", NAMES)
def test_each_reversed_sign_is_found_alone(name: str) -> None:
    log = changed(make_log(2, noise=0.01), {name: -1.0})
    verdicts = kinematics.check_kinematics(log)
    for other, agreement in verdicts.items():
        assert (agreement.level == "error") == (other == name), agreement.verdict
    assert "opposite sign" in verdicts[name].verdict
    assert "scale: -1 in the mapping" in verdicts[name].verdict
    assert "in all runs that move" in verdicts[name].verdict
    assert [f.where for f in log.quality().errors] == [name]
    with pytest.raises(InputError, match="opposite sign"):
        log.quality().refuse_errors()


@pytest.mark.parametrize(
    ("name", "factor", "word"),
    [
        ("r", 180 / np.pi, "rates: deg"),
        ("u", 100.0, "cm/s"),
        ("v", 1.943844, "knots"),
        ("w", -1000.0, "mm/s"),
    ],
)
def test_units_are_recognised(name: str, factor: float, word: str) -> None:
    agreement = kinematics.check_kinematics(changed(make_log(1), {name: factor}))[name]
    assert agreement.level == "error"
    assert word in agreement.verdict
    assert agreement.scale == pytest.approx(factor, rel=0.02)


def test_an_odd_scale_is_a_warning() -> None:
    agreement = kinematics.check_kinematics(changed(make_log(1), {"u": 1.5}))["u"]
    assert agreement.level == "warning"
    assert "1.5" in agreement.verdict


@pytest.mark.parametrize("scale", [1.57, 1.7, 2.25])
def test_a_scale_that_is_clearly_no_unit_is_a_warning_too(scale: float) -> None:
    """In knots a speed is 1.94 times as large: 1.7 is near that, and yet no knots where the slope is so well known."""
    agreement = kinematics.check_kinematics(changed(make_log(1), {"w": scale}))["w"]
    assert agreement.level == "warning" and "knots" not in agreement.verdict
    assert agreement.scale == pytest.approx(scale, rel=0.02) and abs(agreement.correlation) > 0.99


@pytest.mark.parametrize("seed", range(3))
def test_knots_are_recognised_where_noise_of_the_position_takes_of_the_slope(seed: int) -> None:
    """Errors in what a slope is taken on bring it towards zero: here from 1.94 to between 1.75 and 1.9."""
    rng = np.random.default_rng(seed)
    run = changed(make_log(1), {"v": 1.943844}).runs[0]
    noisy = with_nu(run, run.nu, position=run.position + 0.1 * rng.normal(size=run.position.shape))
    found = kinematics.check_kinematics(Log.from_runs([noisy]))["v"]
    assert 1.75 < found.scale < 1.9 and found.correlation < 0.985
    assert "in knots" in found.verdict


@pytest.mark.parametrize(
    ("scale", "correlation", "expected"),
    [(1.94, 1.0, True), (1.75, 1.0, False), (1.75, 0.9, True), (1.5, 0.8, False), (2.2, 0.8, False)],
)
def test_a_slope_is_that_of_a_unit_only_within_what_noise_takes_of_it(
    scale: float, correlation: float, expected: bool
) -> None:
    assert kinematics._may_be(1.943844, scale, correlation) is expected


def test_exchanged_axes_are_named() -> None:
    log = make_log(1)
    run = log.runs[0]
    swapped = Log.from_runs([with_nu(run, run.nu[:, [0, 1, 2, 4, 3, 5]])])
    verdicts = kinematics.check_kinematics(swapped)
    assert "belongs to q" in verdicts["p"].verdict
    assert "belongs to p" in verdicts["q"].verdict


def test_a_turned_sensor_is_no_exchange_of_axes() -> None:
    run = make_run(1500)
    nu = np.array(run.nu)
    nu[:, 1] = 0.2 * nu[:, 0] + 0.02 * nu[:, 1]
    agreement = kinematics.check_kinematics(Log.from_runs([with_nu(run, nu)]))["v"]
    assert agreement.level == "warning"
    assert "holds 0.20 of u" in agreement.verdict
    assert "velocity_misalignment" in agreement.cure


def test_a_channel_of_another_world_is_a_warning() -> None:
    run = make_run(1500)
    nu = np.array(run.nu)
    nu[:, 5] = np.sin(3.1 * run.t) * np.sin(0.37 * run.t)
    agreement = kinematics.check_kinematics(Log.from_runs([with_nu(run, nu)]))["r"]
    assert agreement.level == "warning"
    assert "not as the derivative" in agreement.verdict


def test_delay_is_measured() -> None:
    run = make_run(1500, dt=0.05)
    late = np.array(run.nu)
    late[4:, :3] = run.nu[:-4, :3]
    log = Log.from_runs([with_nu(run, late)])
    verdicts = kinematics.check_kinematics(log)
    for name in "uvw":
        assert verdicts[name].lag == pytest.approx(0.2, abs=0.02)
    assert abs(verdicts["p"].lag) < 0.01
    found = [f for f in log.quality().warnings if f.where == "delay"]
    assert "u +0.20 s" in found[0].what
    assert "p" not in found[0].what.split(":")[1]


def test_no_motion_gives_no_verdict() -> None:
    run = make_run(500)
    rng = np.random.default_rng(0)
    still = with_nu(
        run,
        1e-3 * rng.normal(size=(500, 6)),
        quaternion=np.tile([1.0, 0, 0, 0], (500, 1)),
        position=1e-4 * rng.normal(size=(500, 3)),
    )
    for agreement in kinematics.check_kinematics(Log.from_runs([still])).values():
        assert agreement.level == "info"
        assert "could not be compared" in agreement.verdict


def test_no_position_no_verdict_on_velocity() -> None:
    run = make_run(500)
    log = Log.from_runs([with_nu(run, run.nu, position=None)])
    assert set(kinematics.check_kinematics(log)) == {"p", "q", "r"}


@pytest.mark.parametrize(
    ("index", "sign", "answer", "cure"),
    [
        ([1, 2, 3, 0], [1, 1, 1, 1], "xyzw", "quaternion: xyzw"),
        ([3, 0, 1, 2], [1, 1, 1, 1], "wxyz", "quaternion: wxyz"),
        ([0, 1, 2, 3], [1, -1, -1, -1], "inverse", "scale: -1 for qx, qy and qz"),
    ],
)
def test_quaternion_order(index: list[int], sign: list[int], answer: str, cure: str) -> None:
    run = make_run(1500, noise=0.01)
    wrong = with_nu(run, run.nu, quaternion=run.quaternion[:, index] * np.array(sign))
    log = Log.from_runs([wrong])
    assert kinematics.attitude_order(log) == answer
    errors = log.quality().errors
    assert [f.where for f in errors] == ["attitude"]
    assert cure in errors[0].cure
    assert kinematics.attitude_order(Log.from_runs([run])) is None


def test_gaps_and_missing_samples_do_not_disturb() -> None:
    run = make_run(1500)
    t = np.array(run.t)
    t[700:] += 30.0
    quaternion = np.array(run.quaternion)
    quaternion[100:110] = np.nan
    log = Log.from_runs([with_nu(run, run.nu, t=t, quaternion=quaternion)])
    for agreement in kinematics.check_kinematics(log).values():
        assert "agrees" in agreement.verdict
