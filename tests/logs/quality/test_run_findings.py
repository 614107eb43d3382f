"""Runs that are bad by themselves: found among good ones, and no good run is blamed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from auvnn.logs import Log
from auvnn.logs.quality.run_findings import by_run, heading_offset
from tests.log_samples import make_log, make_run


def turned(run, angle):
    """The same run with its heading off by an angle: what a compass that was not aligned reports."""
    xyzw = run.quaternion[:, [1, 2, 3, 0]]
    off = (Rotation.from_euler("z", angle) * Rotation.from_quat(xyzw)).as_quat()
    return replace(run, quaternion=off[:, [3, 0, 1, 2]])


def findings(runs):
    log = Log.from_runs(runs)
    return by_run(log, log.quality().kinematics)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_good_runs_are_not_blamed(noise):
    assert findings(make_log(4, noise=noise).runs) == []


@pytest.mark.parametrize("angle", [0.66, -0.4, 3.0])
def test_a_heading_that_is_off_is_found_with_its_cure(angle):
    runs = list(make_log(4, noise=0.01).runs)
    runs[2] = turned(runs[2], angle)
    measured = heading_offset(runs[2])
    assert measured is not None and measured[0] == pytest.approx(-angle, abs=0.02)
    found = [f for f in findings(runs) if "heading is off" in f.what]
    assert [f.where for f in found] == ["run 3"]
    assert f"{angle:+.2f}"[:4] in found[0].what and f"add {-angle:+.2f}"[:7] in found[0].cure
    # Turned back as the cure says, the run is as good as the others.
    runs[2] = turned(runs[2], -angle)
    assert findings(runs) == []


def test_what_all_runs_share_is_the_sensor_and_not_the_compass():
    found = findings([turned(run, 0.3) for run in make_log(4, noise=0.01).runs])
    assert [f.where for f in found] == ["heading"] and "velocity_misalignment" in found[0].cure


def test_one_run_with_a_turned_sign_is_told_where_the_pooled_figures_hide_it():
    runs = list(make_log(5, noise=0.01).runs)
    nu = runs[1].nu.copy()
    nu[:, 4] *= -1.0
    runs[1] = replace(runs[1], nu=nu)
    log = Log.from_runs(runs)
    assert log.quality().kinematics["q"].level == "info"
    found = by_run(log, log.quality().kinematics)
    assert [f.where for f in found] == ["run 2"] and "q has the opposite sign" in found[0].what
    assert any(f.where == "run 2" and "opposite" in f.what for f in log.quality().findings)


def test_headings_averaged_across_the_wrap_are_counted():
    run = make_run(n=400)
    t = run.t
    psi = np.angle(np.exp(1j * (np.pi - 0.3 + 0.02 * np.arange(len(t)))))
    good = Rotation.from_euler("z", psi[:, None]).as_quat()[:, [3, 0, 1, 2]]
    assert not [f for f in findings([replace(run, quaternion=good)]) if "wrap" in f.what]
    wrong = psi.copy()
    at = int(np.flatnonzero(np.abs(np.diff(psi)) > 3)[0])
    wrong[at] = 0.5 * (psi[at - 1] + psi[at + 1])
    assert abs(wrong[at]) < 0.5
    bad = Rotation.from_euler("z", wrong[:, None]).as_quat()[:, [3, 0, 1, 2]]
    found = [f for f in findings([replace(run, quaternion=bad)]) if "wrap" in f.what]
    assert len(found) == 1 and found[0].what.startswith("one heading")
