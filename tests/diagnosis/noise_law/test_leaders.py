"""What was found beside other effects is a candidate by itself, from the values that it had there."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.noise_law.rounds.leaders import fitted_alone, rivals_of, sensing_alone
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

NAMES = ["net_buoyancy", "constant_force"]


def test_an_effect_that_was_named_second_is_fitted_by_itself():
    truth = GreyBox(small_vehicle()).with_effects({"net_buoyancy": {"force": 5.0}})
    log = make_log(truth, noise=1.0)
    model = GreyBox(small_vehicle())
    windows, layout = windows_for(model, log), lay_out(model, NAMES)
    first = fit_hypothesis(layout, windows, (), (), iterations=3)
    alone = fit_hypothesis(layout, windows, (), ["constant_force"], iterations=3)
    both = fit_hypothesis(layout, windows, (), ["constant_force", "net_buoyancy"], iterations=3)
    steps = [{"verdict": "named", "effects": [n], "p_value": 0.0} for n in ("constant_force", "net_buoyancy")]
    asked: Any = SimpleNamespace(layout=layout, base=(), say=lambda words: None)
    state: Any = SimpleNamespace(windows=windows, first=first, tried=(alone, both), steps=steps)
    found = {e.effects: e for e in fitted_alone(asked, state)}
    assert set(found) == {("constant_force",), ("net_buoyancy",)}
    assert found[("constant_force",)] is alone
    value = float(found[("net_buoyancy",)].fitted.theta[0])
    assert value == pytest.approx(5.0, abs=0.5)


def test_effects_that_change_what_sensors_report_are_fitted_by_themselves_one_as_it_is_asked_for():
    truth = GreyBox(small_vehicle()).with_effects({"velocity_scale": {"factor": 1.2}})
    log, model = make_log(truth, noise=1.0), GreyBox(small_vehicle())
    names = ("constant_force", "gyro_bias", "velocity_scale")
    windows, layout = windows_for(model, log), lay_out(model, names)
    first = fit_hypothesis(layout, windows, (), (), iterations=3)
    tried = fit_hypothesis(layout, windows, (), ["gyro_bias"], iterations=3)
    said: list[str] = []
    asked: Any = SimpleNamespace(layout=layout, base=(), say=said.append, usable=names)
    state: Any = SimpleNamespace(windows=windows, first=first, tried=(tried,))
    found = sensing_alone(asked, state)
    assert next(found) is tried and not said
    (other,) = found
    assert other.effects == ("velocity_scale",) and said == ["fitting velocity_scale alone"]
    assert float(other.fitted.theta[0]) == pytest.approx(1.2, abs=0.02)


def test_what_is_known_to_be_confused_with_the_leader_is_fitted_too():
    def score(p_value, degrees=1):
        return SimpleNamespace(p_value=p_value, degrees=degrees, evidence=-np.log(p_value))

    found: Any = [
        SimpleNamespace(name="tether", evidence=-10.0),
        SimpleNamespace(name="waves", evidence=-20.0),
    ]
    scores: Any = {
        "tether": score(1e-9), "waves": score(1e-9), "payload": score(1e-9), "biofouling": score(1e-5),
        "ocean_current": score(1e-7), "net_buoyancy": score(0.3), "constant_force": score(1e-6, degrees=0),
    }  # fmt: skip
    # "payload" is not known to be confused with a tether, and of a constant force such a log says nothing.
    assert rivals_of(found, scores, 0.01) == ["ocean_current", "biofouling"]
    assert rivals_of(found, scores, 1e-5) == ["ocean_current"]
    assert rivals_of(found, scores, 1e-5, among_all=False) == ["ocean_current"]
    assert rivals_of(found, scores, 2e-5, among_all=False) == ["ocean_current", "biofouling"]
    assert rivals_of([], scores, 0.01) == []


@pytest.mark.parametrize(
    ("odds", "expected"), [(100.0, ["payload", "thruster_gain"]), (700.0, ["payload"]), (2000.0, [])]
)
def test_what_led_alone_is_fitted_beside_a_name_whatever_its_test_promises(monkeypatch, odds, expected):
    """Beside a sensor's scale the slope at the null of a large overshoot said nothing of what it brings."""
    names = ["tether", "ocean_current", "payload", "thruster_gain", "thruster_lag", "waves"]
    scores = {
        n: SimpleNamespace(degrees=int(n != "waves"), evidence=-9.0, gain=0.0, p_value=1.0) for n in names
    }
    alone = {
        "ocean_current": 1500.0,
        "waves": 1200.0,
        "payload": 900.0,
        "thruster_gain": 500.0,
        "thruster_lag": 300.0,
    }
    asked: list[str] = []
    monkeypatch.setattr(LeaderFits, "_one", lambda self, name, at, known: asked.append(name))
    looks = LeaderFits(None, None, lambda _: None)  # type: ignore[arg-type]
    # The catalogue knows that a tether and a current are confused; of waves the log says nothing.
    at: Any = Round(SimpleNamespace(scores=scores), None, [], ["tether"], {}, None, alone)  # type: ignore[arg-type]
    looks.leading(at, [], odds, 0.01)
    assert asked == expected


def test_what_was_fitted_beside_an_explanation_gains_what_its_fit_does():
    here, elsewhere = SimpleNamespace(evidence=100.0), SimpleNamespace(evidence=100.0)
    fits: Any = LeaderFits(None, None, print)  # type: ignore[arg-type]
    fits.known[id(here), "waves"] = here, SimpleNamespace(name="waves", evidence=97.0)
    fits.known[id(here), "tether"] = here, SimpleNamespace(name="tether", evidence=112.0)
    fits.known[id(here), "payload"] = here, None
    fits.known[id(elsewhere), "flooding"] = elsewhere, SimpleNamespace(name="flooding", evidence=500.0)
    assert fits.gains(here) == {"waves": -3.0, "tether": 12.0}
