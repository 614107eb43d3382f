"""The plain regression: exact where the world is linear, blind to what is left out, cut where it runs away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from auvnn.logs import Log, Run
from auvnn.metrics.derivative import Derivative
from auvnn.metrics.folds import Folds
from auvnn.metrics.regression import Regression, baseline, regressors, worse_than
from auvnn.metrics.rollouts import scale_of, scored
from auvnn.metrics.windows import cut_windows

MEASURED = Derivative("measured", 4, 2)
RATE = 10.0


def coefficients(seed=0):
    """A stable B, (6, 22): six commands, no fins; damping on the diagonal, everything else small and coupled."""
    random = np.random.default_rng(seed)
    b = 0.05 * random.normal(size=(6, 22))
    b[:, :6] -= np.diag([0.6, 0.8, 0.9, 1.2, 1.5, 0.7])
    b[:, 6:12] -= np.diag([0.5, 0.6, 0.8, 0.3, 0.4, 0.5])
    b[3:, 18:21] = [[0.0, -1.5, 0.0], [1.8, 0.0, 0.0], [0.0, 0.0, 0.0]]
    return b


def world(runs=3, seconds=15.0, seed=1):
    """A log of that world by scipy's integrator, commands held between samples."""
    b, found = coefficients(), []
    for number in range(runs):
        random = np.random.default_rng(seed + number)
        t = np.arange(0.0, seconds, 1 / RATE)
        command = np.cumsum(random.normal(size=(len(t), 6)), axis=0) * 0.05
        command -= command.mean(0)

        def rate(_, x, held):
            turn = Rotation.from_quat(x[[1, 2, 3, 0]] / np.linalg.norm(x[:4]))
            down = turn.inv().apply([0.0, 0.0, 1.0])
            nu = x[4:]
            nu_dot = b @ np.concatenate([nu, np.abs(nu) * nu, held, down, [1.0]])
            w, v = x[0], x[1:4]
            half = 0.5 * np.concatenate([[-v @ nu[3:]], w * nu[3:] + np.cross(v, nu[3:])])
            return np.concatenate([half, nu_dot])

        states = [np.concatenate([[1.0, 0, 0, 0], 0.1 * random.normal(size=6)])]
        for k in range(len(t) - 1):
            done = solve_ivp(rate, (t[k], t[k + 1]), states[-1], args=(command[k],), rtol=1e-7, atol=1e-9)
            states.append(done.y[:, -1])
        states = np.array(states)
        acceleration = np.array([rate(0, x, c)[4:] for x, c in zip(states, command, strict=True)])
        quaternion = states[:, :4] / np.linalg.norm(states[:, :4], axis=1, keepdims=True)
        found.append(
            Run(
                number=number,
                t=t,
                quaternion=quaternion,
                nu=states[:, 4:],
                nu_dot=acceleration,
                wrench=command,
            )
        )
    return Log.from_runs(found, name="linear")


@pytest.fixture(scope="module")
def log():
    return world()


def test_a_linear_world_is_found_exactly_and_predicted_by_another_integrator(log):
    found = Regression.of(log, "wrench", MEASURED)
    assert np.allclose(found.whole, coefficients(), atol=1e-6)
    windows = cut_windows(log, 5.0, 2.5, kind="wrench")
    for left_out in (False, True):
        seen = found.predict(windows, left_out=left_out)
        assert np.abs(seen - windows.nu.numpy()).max() < 1e-6


def test_what_is_left_out_has_no_say(log):
    folds = Folds.of(log)
    strange = log.runs[1]
    changed = replace(strange, nu_dot=strange.nu_dot + 3.0)
    other = Log.from_runs([log.runs[0], changed, log.runs[2]], name="strange")
    before, after = (
        Regression.of(log, "wrench", MEASURED, folds),
        Regression.of(other, "wrench", MEASURED, folds),
    )
    own = int(folds.at(1, strange.t)[0])
    assert set(folds.at(1, strange.t)) == {own}
    assert np.allclose(before.without[own], after.without[own])
    assert not np.allclose(before.whole, after.whole)


def test_the_filter_acts_on_both_sides(log):
    """By estimated accelerations of a noise-free log those of the commands are the world's."""
    plain = Log.from_runs([replace(r, nu_dot=None) for r in log.runs], name="plain")
    found = Regression.of(plain, "wrench", Derivative("local_polynomial", 2, 2))
    assert np.abs(found.whole[:, 12:18] - coefficients()[:, 12:18]).max() < 0.02


def test_a_regression_that_runs_away_is_cut_and_counted(log):
    windows = cut_windows(log, 5.0, 2.5, kind="wrench")
    found = Regression.of(log, "wrench", MEASURED)
    wild = replace(found, whole=found.whole + 40.0 * np.eye(6, found.whole.shape[1]))
    scale = scale_of(log)
    ran = scored(windows, wild.predict(windows, left_out=False), scale)
    assert ran.diverged.any() and np.nanmax(ran.nrmse(scale)) <= 10.0 + 1e-9


def test_regressors_are_in_the_order_of_the_contract():
    nu, command, down = (
        np.arange(1.0, 7.0) * [1, -1, 1, -1, 1, -1],
        np.array([7.0, 8.0]),
        np.array([0.1, 0.2, 0.9]),
    )
    row = regressors(nu, command, np.array([0.5]), down)
    assert np.allclose(row, [*nu, *(np.sign(nu) * nu**2), 7, 8, 0.5, 0.1, 0.2, 0.9, 1])


def test_baseline_says_where_a_model_loses(log):
    scale = scale_of(log)
    windows = cut_windows(log, 5.0, 2.5, kind="wrench")
    still = scored(windows, np.repeat(windows.nu.numpy()[:, :1], windows.nu.shape[1], axis=1), scale)
    line = baseline(Regression.of(log, "wrench", MEASURED), still, scale, left_out=True)
    held = dict(zip("uvwpqr", still.nrmse(scale).tolist(), strict=True))
    assert line["persistence"]["total"] == pytest.approx(still.total(scale))
    assert line["total"] < 1e-3 < line["persistence"]["total"]
    assert worse_than(held, line) == {"baseline": list("uvwpqr"), "persistence": []}
    assert worse_than({**held, "w": 1.01 * held["w"]}, line)["persistence"] == ["w"]


def test_runs_are_left_out_whole_unless_one_alone_drives_a_degree_of_freedom(log):
    assert [set(Folds.of(log).at(n, log.runs[n].t)) for n in range(3)] == [{0}, {1}, {2}]
    calm = []
    for run in log.runs[:2]:
        nu = run.nu.copy()
        nu[:, 3] *= 0.01
        calm.append(replace(run, nu=nu))
    folds = Folds.of(Log.from_runs([*calm, log.runs[2]], name="roll in one run"))
    assert [len(set(folds.at(n, log.runs[n].t))) for n in range(3)] == [1, 1, 5]
    windows = cut_windows(log, 2.0, 1.0, kind="wrench")
    own, free = folds.windows(windows)
    begin, end = windows.times[:, windows.warmup].numpy(), windows.times[:, -1].numpy()
    for b in np.flatnonzero(windows.run == 2):
        touched = set(folds.at(2, np.linspace(begin[b], end[b], 50)))
        assert own[b] in touched
        assert {folds.numbers[k] for k in np.flatnonzero(~free[b])} == touched
