"""Effects that the model has already: named where the log contradicts what the model says of them, and else not."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import auvnn
from auvnn.diagnosis import diagnose
from auvnn.diagnosis.diagnose import searched
from auvnn.diagnosis.hypotheses.candidates import candidates_for, windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import initial_guess, lay_out
from auvnn.diagnosis.score_tests.shape_search import searched_start
from auvnn.diagnosis.stages.what_is_left import without_stated
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

# The module, of which the package's function has the name.
diagnosing = sys.modules["auvnn.diagnosis.diagnose"]
NAMES = ["ocean_current", "current_shear", "net_buoyancy", "thruster_gain"]
# What was fitted on another day, a tenth of a millimetre per second sure.
KNOWN = {"ocean_current": {"v_north": 0.2, "v_east": -0.1, "uncertainty": {"v_north": 1e-4, "v_east": 1e-4}}}
OTHER = {"ocean_current": {"v_north": -0.15, "v_east": 0.2}}


def model(effects):
    values = {n: {k: v for k, v in of.items() if k != "uncertainty"} for n, of in effects.items()}
    made = GreyBox(small_vehicle()).with_effects(values)
    for name, of in effects.items():
        made.effect(name).state_uncertainty(of.get("uncertainty", {}))
    return made


def log_of(effects):
    return make_log(model(effects), runs=3, duration=30.0, noise=0.5)


def answer(known, log, names=NAMES):
    return diagnose(known, log, names, advice=False, whiteness=False)


@pytest.fixture(scope="module")
def changed():
    log = log_of(OTHER)
    return log, answer(model(KNOWN), log)


def test_a_current_that_has_changed_is_named_as_that_and_not_as_one_that_goes_by_depth(changed):
    """Held near its stated value, it left a motion of the water that other effects of the water take up in part."""
    _, found = changed
    assert found.verdict == "named" and list(found.missing) == ["ocean_current"]
    assert [s["verdict"] for s in found.steps] == ["named", "adequate"]
    told = next(c for c in found.candidates if c["effect"] == "ocean_current")["parameters"]
    for name, value in OTHER["ocean_current"].items():
        assert told[name]["value"] == pytest.approx(value, abs=max(4.0 * told[name]["std"], 1e-4))


def test_the_answer_tells_both_values(changed):
    _, found = changed
    assert found.stated == {"ocean_current": {"v_north": 0.2, "v_east": -0.1, "v_down": 0.0}}
    assert found.to_dict()["stated"] == found.stated
    first = found.story[0]
    assert first.startswith(
        "Other than the model states: ocean_current (the water moves over ground): v_north -0.15"
    )
    assert "where the model has 0.2 m/s" in first and "where the model has -0.1 m/s" in first
    assert "Missing" not in " ".join(found.story)


def test_what_was_found_goes_into_add_and_the_new_values_into_the_model(changed):
    log, found = changed
    better = auvnn.add(model(KNOWN), log, found.missing, horizons=("5",))
    assert better.accepted and better.model.effect_names == ["ocean_current"]
    values = better.model.effect("ocean_current").values()
    assert values["v_north"] == pytest.approx(-0.15, abs=1e-3)
    # What the fall is measured from has the values that the model stated.
    assert better.waterfall[0]["error"] == pytest.approx(better.waterfall[1]["error"], rel=0.1)
    with pytest.raises(ConfigError, match="has ocean_current already: refit=true"):
        auvnn.add(model(KNOWN), log, ["ocean_current"])
    again = auvnn.add(model(KNOWN), log, "ocean_current", refit=True, horizons=("5",))
    assert again.model.effect("ocean_current").values() == values


def test_where_the_model_is_right_nothing_is_named():
    found = answer(model(KNOWN), log_of(KNOWN))
    assert found.verdict == "adequate" and found.missing == [] and found.stated == {}


def test_another_effect_is_named_beside_one_that_the_model_has_right():
    found = answer(model(KNOWN), log_of({**KNOWN, "net_buoyancy": {"force": 5.0}}))
    assert list(found.missing) == ["net_buoyancy"] and found.stated == {} and not found.missing.refit
    assert found.story[0].startswith("Missing: net_buoyancy")


def test_the_force_of_a_change_is_that_of_the_change_alone():
    known = {"net_buoyancy": {"force": 20.0, "uncertainty": {"force": 0.1}}}
    found = answer(model(known), log_of({"net_buoyancy": {"force": 25.0}}))
    assert list(found.missing) == ["net_buoyancy"]
    force = found.matters["net_buoyancy"]["force"]
    total = np.sqrt(sum(force[a] ** 2 for a in "XYZ"))
    assert total == pytest.approx(5.0, rel=0.1)


def test_it_is_no_name_where_a_force_without_a_name_is_left():
    """Where the model lacks something, the values of its effects are the first to move."""
    _, found = searched(model(KNOWN), log_of(OTHER), NAMES, advice=False, whiteness=False, costs=False)
    asked, state = found.setting, found.state
    first, _ = state.steps
    assert without_stated(asked, state) is state
    unknown = {"verdict": "unknown", "effects": [], "p_value": 0.0}
    given = without_stated(asked, state.but(steps=(first, unknown)))
    assert [s["verdict"] for s in given.steps] == ["unknown"] and given.nearest == ("ocean_current",)
    assert given.chosen == () and given.current is state.first and given.refuted is None
    # One that the model lacks comes first.
    other = state.but(steps=({**first, "effects": ["net_buoyancy"]}, first, unknown))
    assert without_stated(asked, other) is other


def test_the_answer_goes_by_it(monkeypatch, changed):
    """The search of `changed`, as if a force had been left that has no name."""
    log, found = changed
    plain = diagnosing.settled

    def unsettled(asked, state):
        settled = plain(asked, state)
        unknown = {"verdict": "unknown", "effects": [], "p_value": 0.0}
        return settled.but(steps=(*(s for s in settled.steps if s["effects"]), unknown))

    monkeypatch.setattr(diagnosing, "settled", unsettled)
    told = answer(model(KNOWN), log)
    assert found.verdict == "named" and told.verdict == "unknown"
    assert told.missing == [] and told.nearest == ["ocean_current"]
    # Of what is nearest it is told as well that the model has it.
    assert [*told.stated] == ["ocean_current"] and not told.missing.refit


def test_the_costs_are_told_as_those_of_the_change(changed):
    told = next(x for x in changed[1].story if x.startswith("ocean_current: "))
    assert told.startswith("ocean_current: with the values that the model has, the error of free running")
    assert "the force of the change is" in told and "without it" not in told


def test_what_each_of_several_adds_does_not_depend_on_their_order():
    """What is uncertain anyway takes up a change that is not large, while it has not been asked for."""
    loose = {
        "ocean_current": {"v_north": 0.1, "uncertainty": {"v_north": 0.05, "v_east": 0.05, "v_down": 0.05}}
    }
    log = log_of({"ocean_current": {"v_north": 0.2}, "net_buoyancy": {"force": 5.0}})
    for names in (["net_buoyancy", "ocean_current"], ["ocean_current", "net_buoyancy"]):
        better = auvnn.add(model(loose), log, names, refit=True, horizons=("5",))
        assert better.accepted and all(entry["accepted"] for entry in better.by_effect.values()), names
        assert "ocean_current" not in better.coefficients


@pytest.mark.parametrize(
    ("stated", "estimate", "begin"), [(0.3, 0.1, 0.1), (0.3, -0.1, 0.1), (0.1, np.nan, 0.1)]
)
def test_a_stated_lag_is_fitted_from_where_its_test_points(stated, estimate, begin):
    layout = lay_out(model({"thruster_lag": {"time_constant": stated}}), ["thruster_lag"])
    assert initial_guess(layout, "thruster_lag", np.array([estimate])) == pytest.approx([begin])


def test_the_fit_of_a_stated_effect_with_a_shape_has_a_beginning():
    """The stand-ins of what is asked for are in its place, and it is not free beside them."""
    known = model({"thrust_advance": {"loss": 0.3}})
    log = log_of({})
    layout, windows = lay_out(known, ["thrust_advance"]), windows_for(known, log)
    base = [n for n in layout.names if n in layout.nuisance]
    found = fit_hypothesis(layout, windows, [n for n in base if n != "thrust_advance"], ())
    assert "thrust_advance" in base
    assert searched_start(layout, windows, found, base, "thrust_advance") is not None


def test_what_is_asked_for():
    known, log = model(KNOWN), log_of(KNOWN)
    assert "ocean_current" not in candidates_for(known, log, None)[0]
    assert "ocean_current" in candidates_for(known, log, None, stated=True)[0]
    # Where the payload is absent its time says nothing; where it is there, its test would be another one.
    loaded = known.with_effects({"payload": {"mass": 1.0, "time": 5.0}})
    usable = candidates_for(loaded, log, None, stated=True)[0]
    assert "payload" not in usable and "ocean_current" in usable
    assert {"ocean_current", "payload"} <= {*lay_out(loaded, usable).nuisance}
