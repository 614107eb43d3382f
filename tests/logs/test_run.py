"""A run holds its shape, cannot be changed by accident, and knows where it is unbroken."""

import numpy as np
import pytest

from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from tests.log_samples import angles, make_log, make_run


def test_arrays_are_read_only_views() -> None:
    source = np.zeros((800, 6))
    run = make_run(nu=source)
    with pytest.raises(ValueError, match="read-only"):
        run.nu[0, 0] = 1.0
    source[0, 0] = 1.0  # the maker's own array stays writable


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"nu": np.zeros((800, 5))}, "'nu'"),
        ({"quaternion": np.zeros((799, 4))}, "'quaternion'"),
        ({"voltage": np.zeros((800, 1))}, "'voltage'"),
        ({"t": np.zeros(800)}, "increasing"),
        ({"t": np.full(800, np.nan)}, "finite"),
        ({"t": np.arange(2.0)}, "2 samples"),
        ({"extra": {"rpm": np.zeros(3)}}, "'rpm'"),
        ({"nu": "words"}, "not an array"),
    ],
)
def test_wrong_shapes_are_refused(changes: dict, word: str) -> None:
    with pytest.raises(InputError, match=word):
        make_run(**changes)


def test_euler_angles_are_the_ones_the_attitude_was_made_of() -> None:
    run = make_run()
    np.testing.assert_allclose(run.euler, angles(run.t)[0], atol=1e-12)


def test_segments_break_at_gaps_and_missing_samples() -> None:
    t = np.concatenate([np.arange(50), 60 + np.arange(50)]) * 0.1
    nu = np.ones((100, 6))
    nu[20, 3] = np.nan
    nu[99] = np.nan
    run = make_run(100, t=t, nu=nu)
    found = [(s.start, s.stop) for s in run.segments()]
    assert found == [(0, 20), (21, 50), (50, 99)]
    assert [(s.start, s.stop) for s in run.segments(min_samples=30)] == [(50, 99)]
    assert [(s.start, s.stop) for s in run.segments(max_gap=5.0)] == [(0, 20), (21, 99)]


def test_a_missing_command_breaks_a_segment_a_missing_voltage_does_not() -> None:
    thrusters = np.zeros((800, 2))
    thrusters[100, 1] = np.nan
    voltage = np.full(800, np.nan)
    assert len(make_run(thrusters=thrusters).segments()) == 2
    run = make_run(voltage=voltage)
    assert len(run.segments()) == 1
    assert "voltage" not in run.channels


def test_cut_keeps_every_block() -> None:
    run = make_run(extra={"rpm": np.arange(800.0)})
    part = run.cut(slice(100, 200))
    assert part.samples == 100
    assert part.extra["rpm"][0] == 100.0
    np.testing.assert_array_equal(part.nu, run.nu[100:200])
    np.testing.assert_array_equal(part.thrusters, run.thrusters[100:200])


def test_split_holds_out_the_last_run_and_says_so() -> None:
    log = make_log(3)
    train, test, words = log.split()
    assert [r.number for r in train.runs] == [1, 2]
    assert [r.number for r in test.runs] == [3]
    assert "run 3" in words


def test_split_holds_out_the_end_of_a_single_run() -> None:
    log = make_log(1)
    train, test, words = log.split(0.3)
    (a,), (b,) = train.runs, test.runs
    assert a.samples + b.samples == 800
    assert b.samples == pytest.approx(240, abs=1)
    assert a.t[-1] < b.t[0]
    assert "30 %" in words
    with pytest.raises(ConfigError, match="between 0 and 1"):
        log.split(1.5)
    with pytest.raises(InputError, match="cannot be split"):
        Log.from_runs([log.runs[0].cut(slice(0, 5))]).split()


def test_select_names_the_runs_there_are() -> None:
    log = make_log(3)
    assert [r.number for r in log.select([3, 1]).runs] == [3, 1]
    with pytest.raises(ConfigError, match=r"\[1, 2, 3\]"):
        log.select(4)


def test_runs_of_different_vehicles_are_refused() -> None:
    with pytest.raises(InputError, match="thrusters"):
        Log.from_runs([make_run(), make_run(number=2, thrusters=np.zeros((800, 6)))])
    with pytest.raises(InputError, match="wrench"):
        Log.from_runs([make_run(), make_run(number=2, wrench=np.zeros((800, 6)))])
    with pytest.raises(InputError, match="twice"):
        Log.from_runs([make_run(), make_run()])
    with pytest.raises(InputError, match="no run"):
        Log.from_runs([])


def test_hash_of_a_log_in_memory_is_that_of_its_samples() -> None:
    assert make_log(2).sha256 == make_log(2).sha256
    assert make_log(2).sha256 != make_log(2, noise=1e-9).sha256


def test_kind_and_columns() -> None:
    log = make_log(1)
    assert log.kind == "thrusters"
    assert log.n_thrusters == 4
    expected = "run t qw qx qy qz u v w p q r x y z thruster_1 thruster_2 thruster_3 thruster_4 voltage"
    assert log.columns == expected.split()
    run = make_run(thrusters=None, wrench=np.zeros((800, 6)))
    assert Log.from_runs([run]).kind == "wrench"
    assert isinstance(run, Run)
    assert run.command is not None
    assert run.command.shape == (800, 6)


def test_gaps_of_voltage_and_altitude_are_bridged_in_time():
    t = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    voltage = np.array([np.nan, 10.0, np.nan, 16.0, np.nan])
    run = Run(number=0, t=t, quaternion=np.tile([1.0, 0, 0, 0], (5, 1)), nu=np.zeros((5, 6)), voltage=voltage)
    assert run.filled("voltage").tolist() == [10.0, 10.0, 12.0, 16.0, 16.0]
    assert run.filled("altitude") is None
    whole = np.arange(5.0)
    assert np.array_equal(Run(0, t, run.quaternion, run.nu, altitude=whole).filled("altitude"), whole)
