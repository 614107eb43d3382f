"""`add`, `compare`, `improve` and `diagnose` on a log whose commands changed between its samples."""

from __future__ import annotations

import json

import pytest

import auvnn
from auvnn.estimation.prediction_error import FitError
from auvnn.improvement import commands_between
from auvnn.improvement.commands_between import path_of
from auvnn.improvement.loop import causes
from auvnn.improvement.loop.improve import Walk
from auvnn.improvement.loop.judge import Judge
from auvnn.metrics.commands.stated import as_stated
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from tests.small_logs import make_log, small_vehicle, thinned

STEP = 5
NAME, FORCE = "net_buoyancy", 8.0


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def logged(model, *, held, first=0, runs=3, hidden=True):
    """Return a log at 5 Hz, its commands held or changed at 25 Hz; of a plant with a net buoyancy, or as the model."""
    plant = model.with_effects({NAME: {"force": FORCE}}) if hidden else model
    rate = 5.0 if held else 5.0 * STEP
    log = make_log(plant, runs=runs, duration=30.0, rate=rate, noise=0.3, max_step=0.04, first=first)
    return log if held else thinned(log, STEP)


@pytest.fixture(scope="module")
def between(model):
    return logged(model, held=False), logged(model, held=False, first=10)


@pytest.fixture(scope="module")
def better(model, between):
    return auvnn.add(model, between[0], NAME, horizons=("5",))


def test_commands_are_taken_as_they_went_and_the_model_states_it(better):
    """Five ticks a sample: two fifths of the next command are in an interval's mean."""
    path = better.model.commands
    assert path.between_samples in ("ahead", "linear", "smooth") and path.interval == pytest.approx(0.2)
    assert path.share_of_next == pytest.approx(0.4, abs=0.12)
    assert better.commands == path.to_dict() == better.to_dict()["commands"]
    assert better.refitted_model.commands == path
    assert path.words() in better.warnings
    # The truth's coefficients are the model's own: with held commands they were off to make up for the commands.
    found = better.coefficients["added_mass"]
    assert all(abs(found[k]["value"] - 1.0) < 0.03 for k in "XYZ")
    assert better.parameters[NAME]["force"]["value"] == pytest.approx(FORCE, rel=0.02)


def test_the_held_out_error_is_that_of_a_model_driven_so(model, better, between, monkeypatch):
    monkeypatch.setattr(commands_between, "clearly_between_samples", lambda *_: False)
    held = auvnn.add(model, between[0], NAME, horizons=("5",))
    assert held.commands is None and held.model.commands is None
    errors = [b.after["rollout"]["5"]["total"] for b in (held, better)]
    assert errors[1] < 0.6 * errors[0]
    # On another day, too, by `compare`, which says what it takes from the model.
    compared = [auvnn.compare(b.model, between[1], horizons=["5"]) for b in (held, better)]
    errors = [c.rollout["5"]["total"] for c in compared]
    assert errors[1] < 0.6 * errors[0]
    told = [[w for w in c.warnings if "between the log's samples" in w] for c in compared]
    assert not told[0] and "The model states it" in told[1][0]


def test_the_next_day_finds_nothing_missing(better, between):
    found = auvnn.diagnose(
        better.model, between[1], [NAME, "added_mass", "thruster_lag"], advice=False, whiteness=False
    )
    assert found.verdict == "adequate" and not found.missing


def test_a_statement_comes_back_from_disk(better, between, tmp_path):
    better.write(tmp_path / "answer")
    assert json.loads((tmp_path / "answer/improvement.json").read_text())["commands"] == better.commands
    better.model.save(tmp_path / "model")
    again = auvnn.compare(tmp_path / "model", between[1], horizons=["5"])
    expected = auvnn.compare(better.model, between[1], horizons=["5"])
    assert again.rollout["5"]["total"] == pytest.approx(expected.rollout["5"]["total"], rel=1e-6)


def test_commands_that_were_held_stay_so_and_an_old_statement_goes(model):
    log = logged(model, held=True)
    plain = auvnn.add(model, log, NAME, horizons=("5",))
    assert plain.commands is None and plain.model.commands is None
    stated = with_commands(model, CommandPath("linear", 0.5, 0.2))
    again = auvnn.add(stated, log, NAME, horizons=("5",))
    assert again.model.commands is None and again.refitted_model.commands is None
    assert commands_between.GONE in again.warnings and commands_between.GONE not in plain.warnings
    assert again.after["rollout"]["5"]["total"] == pytest.approx(
        plain.after["rollout"]["5"]["total"], rel=1e-6
    )


def test_a_statement_for_another_rate_stays(model):
    """A log at 5 Hz whose commands were held says nothing of one at 1 Hz."""
    path = CommandPath("linear", 0.5, 1.0)
    found = auvnn.add(with_commands(model, path), logged(model, held=True), NAME, horizons=("5",))
    assert found.model.commands == path and commands_between.GONE not in found.warnings


def test_a_fit_one_step_ahead_asks_nothing(model, between):
    found = auvnn.add(model, between[0], NAME, objective="one_step", horizons=("5",))
    assert found.commands is None


def test_a_fit_that_has_nowhere_to_begin_leaves_the_one_of_held_commands(model, between, monkeypatch):
    from auvnn.errors import InputError

    def refuse(*_):
        raise InputError("nowhere")

    monkeypatch.setattr(commands_between, "fitted_by", refuse)
    found = auvnn.add(model, between[0], NAME, horizons=("5",))
    assert found.commands is None and found.accepted


def test_the_loop_fits_and_judges_by_commands_as_they_went(model, between):
    found = auvnn.improve(
        model, between[0], test=between[1], effects=[NAME, "thruster_lag"], learn=(), seconds=120.0
    )
    assert found.model.commands.between_samples in ("ahead", "linear", "smooth")
    assert any("between the log's samples" in line for line in found.story)
    assert [s.step for s in found.steps if s.kind == "a cause with a name"] == [NAME]
    assert found.waterfall[-2]["error"] < 1.5 * found.waterfall[-1]["error"]


def test_the_judge_cuts_windows_of_every_length_alike(model, between):
    path = path_of(model.with_effects({NAME: {"force": FORCE}}), between[0])
    driven = with_commands(model, path)
    judge = Judge.of(between[0], model.actuation, driven)
    plain = Judge.of(between[0], model.actuation)
    for seconds in (float(judge.horizon), 1.0):
        mine, others = (j.task(seconds)[0].windows for j in (judge, plain))
        assert (mine.inputs.command == as_stated(driven, others).inputs.command).all()
        assert not (mine.inputs.command == others.inputs.command).all()


def test_nothing_is_asked_where_commands_were_held(model):
    assert path_of(model.with_effects({NAME: {"force": FORCE}}), logged(model, held=True)) is None


def walked(model, log, monkeypatch, answers):
    """Return a walk through the diagnosis, with answers by the names beside which it is asked how commands go."""
    asked = []

    def answer(_, __, names=()):
        asked.append(tuple(names))
        return answers(tuple(names))

    monkeypatch.setattr(causes, "path_of", answer)
    walk = Walk(model, log, None, [NAME, "thruster_lag"], 8, 1e4, None, None)
    walk.commands()
    walk.compare()
    walk.refit()
    walk.diagnose()
    return walk, asked


def test_commands_are_asked_for_again_beside_the_names(model, between, monkeypatch):
    """A force that is missing hides how commands go; beside its name it shows, and everything is fitted again."""
    path = path_of(model, between[0], [NAME])
    assert path.share_of_next == pytest.approx(0.4, abs=0.12)
    walk, asked = walked(model, between[0], monkeypatch, lambda names: path if NAME in names else None)
    assert asked[0] == () and NAME in asked[1] and NAME in asked[-1] and len(asked) == 3
    assert walk.state.model.commands == walk.model.commands == path
    assert [s.step for s in walk.steps if s.kind == "a cause with a name"] == [NAME]
    assert all(s.model.commands == path for s in walk.steps)
    # What had been taken before is told as tried: with commands that are held.
    assert any(s.reason == causes.OTHERWISE and not s.accepted for s in walk.tried)
    told = [w for w in walk.story if w.startswith(f"Beside {NAME}")]
    assert len(told) == 1 and path.words() in told[0] and "fitted again" in told[0]


def test_what_predicts_worse_with_other_commands_is_taken_back(model, between, monkeypatch):
    truth = path_of(model, between[0], [NAME])
    wrong = CommandPath("linear", 1.0, truth.interval)
    walk, _ = walked(model, between[0], monkeypatch, lambda names: wrong if names else truth)
    assert walk.state.model.commands == walk.model.commands == truth
    assert walk.judge.driven.commands == truth and all(s.model.commands == truth for s in walk.steps)
    assert any("predicts worse" in w for w in walk.story)
    assert any(s.reason == causes.OTHERWISE for s in walk.tried) and len(walk.diagnoses) < 3


def test_about_the_same_share_is_no_reason_to_begin_anew(model, between, monkeypatch):
    path = path_of(model, between[0], [NAME])
    near = CommandPath(path.between_samples, path.share_of_next + 0.05, path.interval, path.samples)
    walk, asked = walked(model, between[0], monkeypatch, lambda names: near if names else path)
    assert walk.model.commands == path and len(asked) == 2
    assert not any("fitted again" in w for w in walk.story)


def test_commands_are_asked_for_beside_what_comes_nearest_where_there_is_no_name(model, between, monkeypatch):
    class Unknown:
        verdict, missing, nearest, story, steps = "unknown", [], [NAME], ["Nothing."], []

    path = path_of(model, between[0], [NAME])
    monkeypatch.setattr(causes, "diagnose", lambda *_, **__: Unknown)
    walk, asked = walked(model, between[0], monkeypatch, lambda names: path if names else None)
    assert walk.model.commands == path and asked[1] == (NAME,)


def test_a_statement_for_another_rate_is_not_taken_for_that_of_this_log(model, between, monkeypatch):
    """Held beside the names as before: nothing is fitted again, and the statement stays for its own rate."""
    stated = CommandPath("linear", 0.5, 1.0)
    walk, asked = walked(with_commands(model, stated), between[0], monkeypatch, lambda names: None)
    assert len(asked) == 2 and walk.model.commands == stated
    assert not any("fitted again" in w for w in walk.story)


def test_a_fit_that_fails_is_no_answer_to_how_commands_go(model, between, monkeypatch):
    path = path_of(model, between[0], [NAME])

    def answers(names):
        if names:
            raise FitError("lost")
        return path

    walk, _ = walked(model, between[0], monkeypatch, answers)
    assert walk.model.commands == path and any("lost" in w for w in walk.warnings)


def test_a_diagnosis_that_begins_anew_has_no_more_than_twice_the_time(model, between, monkeypatch):
    """Prediction shall have its turn: a share of the time each, and together no more than twice that."""
    ends = []
    monkeypatch.setattr(Walk, "_rounds", lambda self, part, until: ends.append(until - self.began))
    path = CommandPath("linear", 0.5, 0.2)
    walk = Walk(model, between[0], None, [NAME], 8, 100.0, None, None)
    monkeypatch.setattr(causes, "path_of", lambda *_: path)
    walk.compare()
    walk.diagnoses.append({"nearest": [NAME]})
    walk.diagnose()
    share = 100.0 * causes.PATIENCE
    assert ends[0] == pytest.approx(share) and share < ends[1] <= 2.0 * share + 1e-6
    # Long after its time is up it has twice the share, and not one more from then on.
    monkeypatch.setattr(causes, "path_of", lambda *_: None)
    walk.began -= 2.5 * share
    walk.diagnose()
    assert ends[-1] == pytest.approx(2.0 * share)
