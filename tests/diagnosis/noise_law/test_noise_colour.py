"""The colour of the sensors' noise: found where it is, and not taken for a force nor a force for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.noise_colour import clearly_coloured, noise_colour
from auvnn.estimation.window_normal_equations import TRUST, motion
from auvnn.logs import Log
from auvnn.logs.signals.rotation import from_euler, to_euler
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import path, wandering_log
from tests.small_logs import make_log, small_vehicle

SIZES = {"position": 0.05, "attitude": 0.005, "velocity": 0.01, "rates": 0.005}


def asked(model, log):
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    return noise_colour(first, windows, TRUST * motion(windows) + 1e-9)


def remembering(log: Log, time: float) -> Log:
    """Return a log with noise of one correlation time on everything that is measured."""
    runs = []
    for run in log.runs:
        span, step = float(run.t[-1] - run.t[0]), run.dt
        noise = [path(1.0, time, span, (k, run.number), step)[: run.samples] for k in (1, 2)]
        angles = to_euler(run.quaternion) + SIZES["attitude"] * noise[0][:, 3:]
        sizes = np.repeat([SIZES["velocity"], SIZES["rates"]], 3)
        runs.append(
            replace(
                run,
                position=run.position + SIZES["position"] * noise[0][:, :3],
                quaternion=from_euler(angles),
                nu=run.nu + sizes * noise[1],
            )
        )
    return Log.from_runs(runs, name=log.name)


@pytest.mark.parametrize("time", [0.3, 0.8])
def test_noise_that_remembers_is_found_with_its_time(time):
    model = GreyBox(small_vehicle())
    found = asked(model, remembering(make_log(model, runs=3), time))
    assert found.odds > 100.0
    assert set(found.to_dict()) == set(SIZES)
    for told in found.to_dict().values():
        assert 0.4 < told / time < 2.5


def test_white_noise_is_white_with_and_without_a_force():
    model = GreyBox(small_vehicle())
    assert asked(model, make_log(model, runs=3, noise=1.0)).to_dict() == {}
    assert asked(model, wandering_log(model, 4.0, 1.0, runs=3)).to_dict() == {}


@pytest.mark.parametrize(("time", "clear"), [(0.3, True), (None, False)])
def test_a_clear_colour_is_seen_beside_what_is_missing(time, clear):
    """A constant force of 3 N that the model lacks is no colour, and hides none."""
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects({"constant_force": {"Y": 3.0}}), runs=6, duration=60.0, noise=1.0)
    log = log if time is None else remembering(log, time)
    windows, layout = windows_for(model, log), lay_out(model, [])
    first = fit_hypothesis(layout, windows, list(layout.names), (), iterations=4)
    assert clearly_coloured(first, windows, TRUST * motion(windows) + 1e-9) is clear


def test_what_a_sensor_does_wrong_is_no_colour():
    """Beside a force of 1 N, velocities measured 0.3 m ahead of the origin look like coloured noise without that."""
    model = GreyBox(small_vehicle())
    log = wandering_log(model.with_effects({"velocity_lever_arm": {"x": 0.3, "z": 0.15}}), 1.0, 0.5, runs=3)
    windows, layout = windows_for(model, log), lay_out(model, ["velocity_lever_arm", "constant_force"])
    base = [n for n in layout.names if n not in ("velocity_lever_arm", "constant_force")]
    first = fit_hypothesis(layout, windows, base, (), iterations=6)
    floor = TRUST * motion(windows) + 1e-9

    def beside(name):
        yield fit_hypothesis(
            layout, windows, base, (name,), start=first.fitted, sigma=first.fitted.sigma, iterations=6
        )

    assert noise_colour(first, windows, floor).odds > 100.0
    assert noise_colour(first, windows, floor, beside("constant_force")).odds > 100.0
    assert noise_colour(first, windows, floor, beside("velocity_lever_arm")).to_dict() == {}


def test_noise_that_remembers_keeps_its_colour_beside_a_sensor_that_is_wrong():
    model = GreyBox(small_vehicle())
    log = remembering(make_log(model.with_effects({"velocity_lever_arm": {"x": 0.3}}), runs=3), 0.3)
    windows, layout = windows_for(model, log), lay_out(model, ["velocity_lever_arm"])
    base = [n for n in layout.names if n != "velocity_lever_arm"]
    first = fit_hypothesis(layout, windows, base, (), iterations=4)
    other = fit_hypothesis(layout, windows, base, ("velocity_lever_arm",), iterations=4)
    found = noise_colour(first, windows, TRUST * motion(windows) + 1e-9, [other])
    assert set(found.to_dict()) == set(SIZES)
