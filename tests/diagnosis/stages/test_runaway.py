"""Windows in which the model as given runs away: left out, shortened, or refused with a cure."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import torch

from auvnn.diagnosis.stages.runaway import windows_that_hold
from auvnn.effects import Effect, Parameter
from auvnn.errors import InputError
from auvnn.estimation.scaling import unit_of
from auvnn.metrics.commands.stated import as_stated
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from tests.small_logs import make_log, small_vehicle


@pytest.fixture(scope="module")
def log():
    return make_log(GreyBox(small_vehicle()), runs=2, duration=20.0)


class Driven(Effect):
    """tau <- tau + rate (M_A + 50 kg) nu: whatever the velocity, it grows."""

    name = "driven"
    cause = "a vehicle that runs away"
    symbol = "tau_r"
    reference = "none"

    def __init__(self, rate):
        super().__init__((Parameter("rate", "1/s", 0.0, 1.0, -1e9, 1e9),))
        with torch.no_grad():
            self.theta.fill_(rate)

    def wrench(self, moment, body):
        return self.theta[0] * (moment.nu @ (body.added_mass + 50.0 * torch.eye(6, dtype=moment.nu.dtype)).mT)


def pushing(rate):
    """A vehicle without drag that runs away."""
    drag = {"linear_damping": [0.0] * 6, "quadratic_damping": [0.0] * 6}
    return GreyBox(small_vehicle(**drag), [Driven(rate)])


def test_where_all_hold_nothing_is_said(log):
    windows, notes = windows_that_hold(GreyBox(small_vehicle()), log, None)
    assert notes == [] and len(windows) == 12


def test_a_vehicle_that_runs_away_is_given_shorter_windows_or_refused(log):
    windows, notes = windows_that_hold(pushing(0.4), log, None)
    length = float((windows.times[:, -1] - windows.times[:, windows.warmup]).max())
    assert length <= 2.0 and "windows of" in notes[0]
    with pytest.raises(InputError, match="runs away"):
        windows_that_hold(pushing(20.0), log, None)


def test_a_length_that_was_asked_for_is_not_changed(log):
    with pytest.raises(InputError, match="runs away"):
        windows_that_hold(pushing(0.4), log, 4.0)


def test_units_of_sums_that_say_nothing_are_zero_and_none_overflows():
    units = unit_of(np.diag([4.0, 0.0, -1e13, np.nan, 1e200]))
    np.testing.assert_array_equal(units, [0.5, 0.0, 0.0, 0.0, 1e-100])


def test_commands_go_as_a_model_states_where_it_is_asked_to_drive(log):
    """Of the usual length and of shorter ones; else they are held."""
    step = float(np.median(np.diff(log.runs[0].t)))
    for model in (GreyBox(small_vehicle()), pushing(0.4)):
        stated = with_commands(model, CommandPath("linear", 0.5, step))
        held, _ = windows_that_hold(stated, log, None)
        assert torch.equal(held.inputs.command, windows_that_hold(model, log, None)[0].inputs.command)
        windows, _ = windows_that_hold(stated, log, None, stated)
        assert not torch.equal(windows.inputs.command, held.inputs.command)
        assert torch.equal(windows.inputs.command, as_stated(stated, held).inputs.command)


def test_a_diagnosis_that_does_not_ask_the_log_drives_as_the_model_states(log, monkeypatch):
    from auvnn.diagnosis import diagnose as module

    model = with_commands(GreyBox(small_vehicle()), CommandPath("linear", 0.5, 1.0))
    asked = []

    def told(known, log, window, driven=None):
        asked.append(driven)
        raise InputError("enough")

    monkeypatch.setattr(sys.modules["auvnn.diagnosis.diagnose"], "windows_that_hold", told)
    for stochastic in (False, True):
        with pytest.raises(InputError, match="enough"):
            module(model, log, ["net_buoyancy"], stochastic=stochastic)
    assert asked[0] is not None and asked[0].commands == model.commands and asked[1] is None
