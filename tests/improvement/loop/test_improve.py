"""The whole loop: what is hidden is found, what is not there is not added, and the test log chooses nothing."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import auvnn
from auvnn.errors import ConfigError, InputError
from auvnn.improvement.loop.improve import Walk
from auvnn.improvement.loop.learned import choose
from auvnn.logs import Log
from auvnn.models import GreyBox, load, remove
from tests.small_logs import make_log, small_vehicle

HIDDEN = {"net_buoyancy": {"force": 6.0}, "cg_offset": {"x": 0.02, "y": 0.0, "z": 0.0}}


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def logs(model):
    whole = make_log(model.with_effects(HIDDEN), runs=4, duration=12.0, noise=1.0)
    return whole.select([0, 1, 2]), whole.select([3])


@pytest.fixture(scope="module")
def improved(model, logs, tmp_path_factory):
    told = []
    found = auvnn.improve(
        model, logs[0], test=logs[1], diagnosing=False, effects=["net_buoyancy", "cg_offset", "body_lift"],
        learn=["residual_force"], tell=told.append,
    )  # fmt: skip
    folder = tmp_path_factory.mktemp("improved")
    found.write(folder)
    return found, folder, told


def test_what_is_hidden_is_taken_and_the_error_falls_to_its_floor(improved):
    found, _, _ = improved
    names = [s.step for s in found.steps]
    assert "net_buoyancy" in names and "body_lift" not in names
    error = {w["step"]: w["error"] for w in found.waterfall}
    last = [w for w in found.waterfall if w["kind"] != "left"][-1]["error"]
    assert last < 0.25 * error["as given"] and last < 2.5 * error["noise floor"]
    value = found.model.effect("net_buoyancy").values()["force"]
    assert value == pytest.approx(6.0, abs=0.6)


def test_every_step_pays_on_what_was_left_out(improved):
    found, _, _ = improved
    for step in found.steps:
        assert step.gain["value"] > step.gain["std"] and step.after < step.before
    for before, after in pairwise(found.steps):
        assert after.before == pytest.approx(before.after)


def test_the_answer_is_the_contract_and_the_history_can_be_taken_back(improved, logs):
    folder, told = improved[1:]
    answer = json.loads((folder / "improve.json").read_text())
    assert answer["schema"] == "auvnn/improve/1"
    kinds = {
        "as given",
        "coefficients refitted",
        "a cause with a name",
        "a name that only predicts",
        "learned",
        "left",
    }
    assert {w["kind"] for w in answer["waterfall"]} <= kinds
    assert set("uvwpqr") < set(answer["baseline"]) and answer["baseline"]["persistence"]["total"] > 0
    assert told == answer["story"] and len(told) >= 4
    assert sorted(p.name for p in (folder / "history").iterdir()) == answer["history"]
    given = load(folder / "history" / "00-as-given")
    assert list(given.effect_names) == []
    last = load(folder / "model")
    without = remove(last, "net_buoyancy")
    assert "net_buoyancy" in last.effect_names and "net_buoyancy" not in without.effect_names
    assert (folder / "report.html").stat().st_size > 10_000


def test_the_test_log_chooses_nothing(model, logs, improved):
    found, _, _ = improved
    test = logs[1].runs[0]
    strange = Log.from_runs([replace(test, nu=test.nu + 0.3 * np.sin(test.t)[:, None])], name="strange")
    other = auvnn.improve(
        model, logs[0], test=strange, diagnosing=False, effects=["net_buoyancy", "cg_offset", "body_lift"],
        learn=["residual_force"], force=True,
    )  # fmt: skip
    assert [s.step for s in other.steps] == [s.step for s in found.steps]
    assert other.model.effect("net_buoyancy").values() == found.model.effect("net_buoyancy").values()


def test_a_diagnosis_that_fails_is_told_and_the_loop_goes_on(model, logs, monkeypatch):
    def fails(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr("auvnn.improvement.loop.causes.diagnose", fails)
    found = auvnn.improve(model, logs[0], test=logs[1], effects=["net_buoyancy"], learn=())
    assert any("SVD did not converge" in w for w in found.warnings)
    assert "net_buoyancy" in [s.step for s in found.steps]


def test_time_that_is_up_leaves_what_was_accepted(model, logs):
    found = auvnn.improve(model, logs[0], test=logs[1], seconds=1e-3, learn=())
    assert "time was up" in found.stopped and {s.kind for s in found.steps} <= {"coefficients refitted"}


def test_a_learned_force_is_of_the_inputs_that_it_depends_on(model):
    """A moment in heave that goes with the tilt alone is learned from few inputs, tilt among them."""
    truth = model.with_effects({"net_buoyancy": {"force": 8.0}})
    walk = Walk(model, make_log(truth, runs=3, duration=12.0, noise=0.3), None, [], 1, 600.0, None, None)
    walk.refit()
    choices = choose(model, walk.judge, walk._before() or walk.state, "residual_force")
    assert 1 <= len(choices) <= 2 and all(c.fall > 0.3 and "tilt" in c.words for c in choices)


def test_bad_requests_are_refused(model, logs):
    with pytest.raises(ConfigError, match="polynomial"):
        auvnn.improve(model, logs[0], test=logs[1], learn=["magic"])
    with pytest.raises(InputError):
        auvnn.improve(model, logs[0], test=logs[0])
