"""Free running with commands that go between samples as the model states it, against a plant that was driven so."""

from __future__ import annotations

import pytest
import torch

from auvnn.app.trial import Trial
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.paths import between
from auvnn.metrics.commands.stated import as_stated, interval_of, said
from auvnn.metrics.rollouts import horizon_windows, roll, scale_of
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from auvnn.training.objectives.windows import training_windows
from tests.small_logs import make_log, small_vehicle, thinned

STEP = 5
LINE = CommandPath("linear", 0.5, 0.2)


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def log(model):
    """Return a log at 5 Hz of commands that changed at 25 Hz, without noise."""
    return thinned(make_log(model, runs=2, duration=20.0, rate=25.0, max_step=0.04), STEP)


@pytest.mark.parametrize(
    "path",
    [
        LINE,
        CommandPath("smooth", 0.4, 0.2),
        CommandPath("ahead", 0.3, 0.2),
        CommandPath("averaged", 0.5, 0.2, 4),
    ],
)
def test_windows_are_those_of_the_law(model, log, path):
    windows = horizon_windows(log, "5", model.actuation)
    found = as_stated(with_commands(model, path), windows).inputs
    expected = between(
        windows, path.share_of_next, path.between_samples, samples=path.samples, curves=MeanThrust.of(model)
    ).inputs
    assert torch.equal(found.command, expected.command) and not torch.equal(
        found.command, windows.inputs.command
    )
    assert (found.within is None) == (expected.within is None)


def test_lines_and_cubics_may_go_through_thrusts():
    from auvnn.models import load

    model = load("rov95")
    log = make_log(model, runs=1, duration=10.0, rate=5.0)
    windows = horizon_windows(log, "5", model.actuation)
    through = [CommandPath("smooth", 0.5, 0.2, interpolated=x) for x in ("command", "thrust")]
    commands = [as_stated(with_commands(model, p), windows).inputs.command for p in through]
    expected = between(windows, 0.5, "smooth", curves=MeanThrust.of(model).of_thrusts()).inputs.command
    assert torch.equal(commands[1], expected) and not torch.equal(*commands)


def test_without_a_statement_or_at_another_rate_commands_are_held(model, log):
    windows = horizon_windows(log, "5", model.actuation)
    assert as_stated(model, windows) is windows
    assert as_stated(with_commands(model, CommandPath("linear", 0.5, 0.05)), windows) is windows
    assert interval_of(windows) == pytest.approx(0.2)


def test_free_runs_of_the_true_model_come_nearer_to_what_was_driven(model, log):
    """The commands changed five times an interval: their mean is two fifths on the way, and the vehicle moves by it."""
    scale = scale_of(log)
    held, stated = (
        roll(m, log, "5", scale).total(scale)
        for m in (model, with_commands(model, CommandPath("smooth", 0.4, 0.2)))
    )
    assert stated < 0.2 * held


def test_the_trial_page_and_training_drive_the_model_alike(model, log):
    path = CommandPath("smooth", 0.4, 0.2)
    scale = scale_of(log)
    expected = roll(with_commands(model, path), log, "5", scale, engine="firm").total(scale)
    trial = Trial(with_commands(model, path), log)
    assert trial._as_given("5").total(scale) == pytest.approx(expected, rel=1e-9)
    windows = training_windows(with_commands(model, path), log, 2.0)
    assert windows.inputs.within is not None or not torch.equal(
        windows.inputs.command, training_windows(model, log, 2.0).inputs.command
    )


def test_what_is_assumed_is_said(model):
    assert said(model, 0.2) == []
    stated = with_commands(model, LINE)
    assert "The model states it" in said(stated, 0.2)[0]
    assert "taken as held" in said(stated, 0.05)[0] and "0.05 s apart" in said(stated, 0.05)[0]
