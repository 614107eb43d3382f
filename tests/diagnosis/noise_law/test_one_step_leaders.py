"""Effects fitted one step ahead: where they lead, and what of it is fitted under the law of the force."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import auvnn
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.rounds import leader_fits, name_after_name, one_step_leaders
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.leader_fits import LEADERS_ONE_STEP, LeaderFits
from auvnn.diagnosis.noise_law.rounds.name_after_name import NameAfterName
from auvnn.diagnosis.noise_law.rounds.one_step_leaders import fitted_one_step, thinned
from auvnn.errors import InputError
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of
from auvnn.executors.serial import SERIAL
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import make_log, small_vehicle

OFFSET = {"fin_1": -0.03, "fin_2": -0.16, "fin_3": -0.03, "fin_4": 0.2}


def asked_of(model: GreyBox, log: Any, usable: list[str]) -> Any:
    return SimpleNamespace(model=model, log=log, usable=tuple(usable), say=lambda words: None, pool=SERIAL)


def test_a_large_effect_comes_first_with_values_near_the_truth():
    """Fits under a law of the force stay near the null here: the fins that the model has are beyond the stall."""
    model = auvnn.load("remus100")
    log = auvnn.simulate(
        model, "multisine", hidden={"fin_offset": OFFSET}, duration=40.0, rate=10.0, runs=3, seed=1, noise="realistic"
    ).log  # fmt: skip
    found = fitted_one_step(asked_of(model, log, ["fin_gain", "net_buoyancy", "fin_offset", "cg_offset"]))
    assert next(iter(found)) == "fin_offset"
    assert found["fin_offset"] == pytest.approx(list(OFFSET.values()), abs=0.03)


def test_beside_a_stochastic_force_a_constant_one_is_found():
    truth = GreyBox(small_vehicle()).with_effects({"net_buoyancy": {"force": 12.0}})
    log = wandering_log(truth, np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5]), 1.0, runs=3, duration=40.0, seed=1)
    found = fitted_one_step(asked_of(GreyBox(small_vehicle()), log, ["waves", "net_buoyancy"]))
    assert next(iter(found)) == "net_buoyancy" and found["net_buoyancy"][0] == pytest.approx(12.0, abs=2.0)


def test_without_accelerations_nothing_leads(monkeypatch):
    def none(*_: Any) -> Any:
        raise InputError("no sample with state, command and acceleration")

    monkeypatch.setattr(one_step_leaders, "OneStepRefit", none)
    model = GreyBox(small_vehicle())
    assert fitted_one_step(asked_of(model, make_log(model, runs=1, duration=5.0), ["waves"])) == {}


def test_one_that_cannot_be_fitted_holds_up_no_other(monkeypatch):
    class Beside:
        def __init__(self, *_: Any) -> None:
            pass

        def alone(self, name: str, *, judged: bool) -> Any:
            if name == "waves":
                raise FitError("waves has nowhere to begin")
            fell = {"tether": 0.0, "gyro_bias": 3.0, "net_buoyancy": 8.0}[name]
            return SimpleNamespace(fell=fell, values={"force": fell})

    monkeypatch.setattr(one_step_leaders, "OneStepRefit", Beside)
    model = GreyBox(small_vehicle())
    asked = asked_of(
        model, make_log(model, runs=1, duration=5.0), ["gyro_bias", "waves", "net_buoyancy", "tether"]
    )
    # What explains nothing leads nowhere.
    assert {n: [*v] for n, v in fitted_one_step(asked).items()} == {"net_buoyancy": [8.0], "gyro_bias": [3.0]}
    assert [*fitted_one_step(asked)] == ["net_buoyancy", "gyro_bias"]


def test_of_a_long_log_stretches_are_looked_at(monkeypatch):
    model = GreyBox(small_vehicle())
    log = make_log(model, runs=2, duration=100.0, rate=10.0)
    assert thinned(log) is log
    monkeypatch.setattr(one_step_leaders, "SAMPLES", 1000)
    few = thinned(log)
    assert 0.4 * log.samples < few.samples < 0.6 * log.samples
    assert len({r.number for r in few.runs}) == len(few.runs) > 4
    # From the beginning to the end of each run.
    assert max(r.t[-1] for r in few.runs) > 80.0 and min(r.t[0] for r in few.runs) == 0.0


@pytest.mark.parametrize(("chosen", "expected"), [([], {"a", "e", "f"}), (["waves"], {"a"})])
def test_what_leads_one_step_ahead_is_fitted_as_a_first_name(monkeypatch, chosen, expected):
    scores = {
        n: SimpleNamespace(degrees=int(n != "g"), evidence=-float(k), gain=900.0 - k, p_value=1.0)
        for k, n in enumerate("abcdefg")
    }
    monkeypatch.setattr("auvnn.diagnosis.noise_law.rounds.leader_fits.LEADERS", 1)
    asked: list[str] = []
    monkeypatch.setattr(LeaderFits, "_one", lambda self, name, at, known: asked.append(name))
    values = {n: np.zeros(1) for n in "gfeb"}
    looks = LeaderFits(None, None, lambda _: None)  # type: ignore[arg-type]
    at = Round(SimpleNamespace(scores=scores), None, [], chosen, values)  # type: ignore[arg-type]
    looks.leading(at, [], 10.0, 0.01)
    assert LEADERS_ONE_STEP == 2 and set(asked) == expected


def test_effects_are_fitted_one_step_ahead_once(monkeypatch):
    asked: list[str] = []
    monkeypatch.setattr(
        name_after_name, "fitted_one_step", lambda _: asked.append("log") or {"waves": np.ones(1)}
    )
    search: Any = NameAfterName.__new__(NameAfterName)
    search.asked = None
    assert not asked and search._one_step is search._one_step and asked == ["log"]


def test_a_first_name_begins_where_it_was_fitted_one_step_ahead_too(monkeypatch):
    monkeypatch.setattr(leader_fits, "within_record", lambda *_: True)
    name = "net_buoyancy"
    model = GreyBox(small_vehicle())
    layout = lay_out(model, ["waves", name])
    seen: list[float] = []

    def from_null(_: Any, begun: GreyBox, *__: Any) -> Any:
        seen.append(float(parameters_of(begun, [name])[0]))
        return SimpleNamespace(evidence=-50.0, explanation=None)

    fits: Any = SimpleNamespace(from_null=from_null, windows=None)
    looks = LeaderFits(layout, fits, lambda _: None)
    tested: Any = SimpleNamespace(scores={name: SimpleNamespace(estimate=np.zeros(1))}, at=layout)
    current: Any = SimpleNamespace(evidence=-100.0)
    at = Round(tested, current, [], [], {name: np.array([30.0])})
    assert looks._one(name, at, None) is not None
    assert seen == [0.0, 30.0]
