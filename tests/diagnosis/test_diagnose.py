"""diagnose() on small logs: named, several, adequate, unknown, ambiguous; what it lists and what it may look at."""

from __future__ import annotations

import inspect
import json

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers import answering
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.residuals.input_forces import InputForces
from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log, Run
from auvnn.models import GreyBox
from tests.diagnosis.strange_effects import BottomPull, ClockForce, HeadingForce, listed
from tests.small_logs import make_log, sines, small_vehicle

CURRENT = {"v_north": 0.15, "v_east": -0.10}
AXES = "XYZKMN"
KEYS = {
    "reason",
    "effect",
    "p_value",
    "explained",
    "cv_before",
    "cv_after",
    "parameters",
    "confusable_with",
    "needs",
}


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def by_name(found):
    return {c["effect"]: c for c in found.candidates}


@pytest.fixture(scope="module")
def current(model):
    """A hidden current, three runs of a quarter of a minute, and what was said while it was looked for."""
    log = make_log(model.with_effects({"ocean_current": CURRENT}), runs=3, duration=12.0, noise=1.0)
    told: list[str] = []
    return log, diagnose(model, log, progress=told.append), told


def test_a_hidden_current_is_named_first_and_alone(current):
    _, found, told = current
    assert (found.verdict, found.missing) == ("named", ["ocean_current"])
    assert [(s["verdict"], s["effects"]) for s in found.steps] == [
        ("named", ["ocean_current"]),
        ("adequate", []),
    ]
    assert found.global_p_value < 1e-6 and found.candidates[0]["effect"] == "ocean_current"
    assert any("fitting ocean_current" in t for t in told)


def test_its_parameters_are_found_within_their_standard_errors(current):
    _, found, _ = current
    for name, value in {**CURRENT, "v_down": 0.0}.items():
        p = found.candidates[0]["parameters"][name]
        assert p["unit"] == "m/s" and 0 < p["std"] < 0.02
        assert abs(p["value"] - value) < 4 * p["std"]


def test_the_answer_has_the_contracts_keys_and_the_whole_catalogue(current):
    log, found, _ = current
    answer = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert (
        answer["schema"] == "auvnn/diagnosis/1" and answer["model"] == "small" and answer["log"] == log.name
    )
    assert {
        "derivative",
        "verdict",
        "missing",
        "steps",
        "candidates",
        "unexplained",
        "depends_on",
        "next_experiment",
        "warnings",
    } <= set(answer)
    assert {c["effect"] for c in answer["candidates"]} == set(EFFECTS.names())
    for c in answer["candidates"]:
        assert set(c) == KEYS
        if c["needs"]:
            assert c["p_value"] is None and c["explained"] is None and c["parameters"] == {}
            continue
        assert (
            0 <= c["p_value"] <= 1 and 0 <= c["explained"] <= 1 and c["cv_before"] > 0 and c["cv_after"] > 0
        )
        assert all(set(p) == {"value", "std", "unit"} for p in c["parameters"].values())
        assert all(
            set(x) == {"effect", "similarity"} and 0.5 <= x["similarity"] <= 1 for x in c["confusable_with"]
        )
    needs = {c["effect"]: c["needs"] for c in answer["candidates"] if c["needs"]}
    assert needs["bottom_proximity"] == ["altitude"] and needs["accelerometer_tilt"] == ["du", "dv", "dw"]
    assert "reference_voltage" in needs["voltage_droop"] and "fins" in needs["fin_stall"]
    first = answer["candidates"][0]
    # In the weights of the fit without it, which take what is missing for noise.
    assert first["cv_before"] > 1.2 * first["cv_after"] and 0.9 < first["cv_before"] < 1.2
    assert first["explained"] > 0.8 and answer["unexplained"] < 0.1
    assert answer["depends_on"] == {} and found.story[0].startswith("Missing: ocean_current (")
    names, matrix = found.similarity
    asked = [c["effect"] for c in answer["candidates"] if not c["needs"]]
    assert (
        sorted(names) == sorted(asked) and matrix.shape == (len(asked),) * 2 and (np.diag(matrix) == 1).all()
    )


def test_it_cannot_be_shown_a_test_log():
    assert not any("test" in name for name in inspect.signature(diagnose).parameters)


def test_two_effects_are_found_one_after_the_other(model):
    truth = model.with_effects({"ocean_current": CURRENT, "net_buoyancy": {"force": 5.0}})
    log = make_log(truth, runs=3, duration=12.0, noise=1.0)
    names = ["ocean_current", "net_buoyancy", "cg_offset"]
    found = diagnose(model, log, names, advice=False, whiteness=False)
    assert found.verdict == "named" and set(found.missing) == {"ocean_current", "net_buoyancy"}
    assert [len(s["effects"]) for s in found.steps] == [1, 1, 0] and found.steps[-1]["verdict"] == "adequate"
    assert [c["effect"] for c in found.candidates[:2]] == found.missing
    assert {c["effect"] for c in found.candidates} == set(names)


def test_nothing_hidden_is_adequate(model):
    found = diagnose(model, make_log(model, runs=3, duration=12.0, noise=1.0))
    assert (found.verdict, found.missing, found.unexplained) == ("adequate", [], 0.0)
    assert [s["verdict"] for s in found.steps] == ["adequate"] and found.global_p_value > 0.05
    assert sorted(c["effect"] for c in found.candidates) == sorted(EFFECTS.names())
    assert found.story[0].startswith("Nothing is missing that this log can show")


def test_coefficients_that_are_off_by_their_stated_amounts_are_nothing_missing(model):
    """Drawn with the stated ten per cent; for a vehicle that claims one in a hundred the same log lacks something."""
    random = np.random.default_rng(2)
    drawn = {
        g: dict(zip(AXES, 1 + 0.1 * random.normal(size=6), strict=True))
        for g in ("added_mass", "linear_damping", "quadratic_damping")
    }
    drawn["inertia"] = dict(zip("KMN", 1 + 0.1 * random.normal(size=3), strict=True))
    log = make_log(model.with_effects(drawn), runs=3, duration=12.0, noise=1.0)
    assert diagnose(model, log).verdict == "adequate"
    sure = diagnose(
        GreyBox(small_vehicle(uncertainty=0.005)),
        log,
        ["added_mass", "linear_damping", "net_buoyancy"],
        advice=False,
        whiteness=False,
    )
    assert sure.verdict in ("named", "ambiguous") and set(sure.missing) <= {"added_mass", "linear_damping"}


def test_a_force_that_nobody_can_name_is_unknown_and_its_cause_is_traced(model):
    log = make_log(
        model.rebuilt([HeadingForce.build(model.vehicle, "thrusters", {"force": 8.0})]),
        runs=3,
        duration=20.0,
        noise=1.0,
    )
    found = diagnose(model, log)
    assert (found.verdict, found.missing) == ("unknown", []) and found.steps[0]["effects"] == []
    assert found.unexplained > 0.5
    sway = found.depends_on["Y"]
    assert next(iter(sway)) == "psi" and sway["psi"] > 0.8
    for axis in "XZKMN":
        assert sum(found.depends_on[axis].values()) < 0.05, axis
    assert "Something is missing that no effect of the catalogue explains." in found.story
    assert any("Y on psi" in line for line in found.story)
    json.dumps(found.to_dict(), allow_nan=False)


def test_a_force_that_depends_on_nothing_measured_is_unknown_and_not_blamed_on_anything(model):
    log = make_log(
        model.rebuilt([ClockForce.build(model.vehicle, "thrusters", {"force": 8.0})]),
        runs=3,
        duration=12.0,
        noise=1.0,
    )
    found = diagnose(model, log)
    assert (found.verdict, found.missing) == ("unknown", [])
    # It beats with the clock, and the clock may be told.
    told = [s for shares in found.depends_on.values() for name, s in shares.items() if name != "t"]
    assert max(told, default=0.0) < 0.1


def test_effects_that_lack_a_channel_are_listed_with_what_they_need(monkeypatch, model):
    listed(monkeypatch, BottomPull)
    log = make_log(model, runs=2, duration=10.0, noise=1.0)
    found = by_name(diagnose(model, log, ["bottom_pull", "net_buoyancy"]))
    assert found["bottom_pull"]["needs"] == ["altitude", "voltage"] and found["net_buoyancy"]["needs"] == []
    assert found["bottom_pull"]["p_value"] is None and found["bottom_pull"]["parameters"] == {}
    with_both = Log.from_runs(
        [
            Run(
                r.number,
                r.t,
                r.quaternion,
                r.nu,
                position=r.position,
                thrusters=r.thrusters,
                altitude=2 + 0 * r.t,
                voltage=16 + 0 * r.t,
            )
            for r in log.runs
        ]
    )
    found = by_name(diagnose(model, with_both, ["bottom_pull"]))
    assert found["bottom_pull"]["needs"] == [] and found["bottom_pull"]["p_value"] is not None


def test_effects_that_the_model_has_already_are_asked_for_unless_they_have_a_shape(current, model):
    log, _, _ = current
    known = model.with_effects({"ocean_current": CURRENT, "waves": {"amplitude": 0.0}})
    found = diagnose(known, log, ["ocean_current", "waves", "net_buoyancy"])
    assert found.verdict == "adequate"
    told = by_name(found)
    assert told["ocean_current"]["p_value"] > 0.01 and told["ocean_current"]["reason"] is None
    assert told["waves"]["p_value"] is None and "has a shape: not asked for" in told["waves"]["reason"]


def test_thrusters_at_neutral_say_nothing_about_thrusters_and_no_number_pretends_they_do(model):
    log = make_log(model, runs=2, duration=10.0, noise=1.0, command=np.zeros((101, 8)))
    found = diagnose(model, log, ["thruster_gain", "thruster_lag", "net_buoyancy"])
    candidates = {
        c["effect"]: c for c in json.loads(json.dumps(found.to_dict(), allow_nan=False))["candidates"]
    }
    for name in ("thruster_gain", "thruster_lag"):
        assert candidates[name]["p_value"] == 1.0
        assert all(p["std"] is None for p in candidates[name]["parameters"].values())
    assert candidates["net_buoyancy"]["parameters"]["force"]["std"] > 0
    assert any("says nothing about thruster_gain, thruster_lag" in w for w in found.warnings)


def test_where_no_effect_shows_beside_a_gross_error_the_log_is_not_blamed(model, monkeypatch):
    log = make_log(model, runs=2, duration=10.0, noise=1.0, command=np.zeros((101, 8)))
    names = ["thruster_gain", "thruster_lag"]
    said = diagnose(model, log, names).warnings
    assert any("the log says nothing about" in w for w in said) and not any("free running" in w for w in said)
    monkeypatch.setattr(answering, "noise_share", lambda _: 0.4)
    said = diagnose(model, log, names).warnings
    assert any("free running over 1.6 s is so far from the measurements" in w for w in said)
    assert not any("the log says nothing about" in w for w in said)
    # Where one of them shows, the others are of no use in this log.
    said = diagnose(model, log, [*names, "net_buoyancy"]).warnings
    assert any("the log says nothing about thruster_gain, thruster_lag" in w for w in said)


def test_one_thruster_at_neutral_has_no_gain_while_the_others_have(model):
    t = np.arange(0, 10.05, 0.1)
    command = 0.4 * sines(t, 8, 5)
    command[:, 2] = 0.0
    log = make_log(model, runs=2, duration=10.0, noise=1.0, command=command)
    gains = by_name(diagnose(model, log, ["thruster_gain"]))["thruster_gain"]["parameters"]
    assert np.isnan(gains["thruster_3"]["std"]) and gains["thruster_3"]["value"] == 1.0
    assert all(0 < p["std"] < 0.1 for n, p in gains.items() if n != "thruster_3")


def test_names_are_checked_and_the_same_question_has_the_same_answer(current, model):
    log, _, _ = current
    with pytest.raises(ConfigError, match=r"no effect called 'ocean_curent'. Did you mean 'ocean_current'\?"):
        diagnose(model, log, ["ocean_curent"])
    with pytest.raises(ConfigError, match="max_effects=0 must be at least 1"):
        diagnose(model, log, max_effects=0)
    log = log.select([0, 1])
    found = diagnose(model, log, "ocean_current", max_effects=1)
    assert found.missing == ["ocean_current"] and len(found.candidates) == 1 and len(found.steps) == 2
    again = diagnose(model, log, ["ocean_current", "ocean_current"], max_effects=1)
    assert json.dumps(again.to_dict()) == json.dumps(found.to_dict())


def test_a_log_too_short_to_cross_validate_is_refused(model):
    with pytest.raises(InputError, match="gives only 2 windows of free running: record a longer log"):
        diagnose(model, make_log(model, runs=1, duration=2.4))


def test_windows_are_five_seconds_or_shorter_where_the_log_is_short(model):
    t = np.arange(0, 100.05, 0.1)

    def still(duration):
        part = t[t <= duration + 1e-9]
        return Log.from_runs(
            [
                Run(
                    0,
                    part,
                    np.tile([1.0, 0, 0, 0], (len(part), 1)),
                    np.zeros((len(part), 6)),
                    thrusters=np.zeros((len(part), 8)),
                )
            ]
        )

    assert np.median(windows_for(model, still(100.0)).length) == 51
    assert np.median(windows_for(model, still(24.0)).length) == 21
    assert np.median(windows_for(model, still(6.0)).length) == 11


def test_one_run_is_said_to_be_one_run(current, model):
    """And a model without a single doubt is diagnosed like any other, with a warning."""
    log, _, _ = current
    sure = GreyBox(small_vehicle(uncertainty=0.0))
    found = diagnose(sure, log.select([0]), ["ocean_current"], max_effects=1)
    assert found.missing == ["ocean_current"]
    assert any("holds one run" in w for w in found.warnings)
    assert any("no coefficient of the model is uncertain" in w for w in found.warnings)


def test_a_dependence_is_looked_for_among_all_that_is_measured(current, model):
    log, _, _ = current
    probe = InputForces(model, windows_for(model, log))
    assert set(probe.inputs) == {
        *"uvwpqr",
        "phi",
        "theta",
        "psi",
        *(f"thruster_{i}" for i in range(1, 9)),
        *"xyz",
        "t",
    }
    each = np.concatenate([probe.columns(i, n) for i in range(6) for n in probe.inputs])
    assert sorted(each) == list(range(len(probe.parameters_of)))
    names = [probe.parameters_of[k].name for k in probe.columns(4, "thruster_2")]
    assert names == ["M_thruster_2_1", "M_thruster_2_2", "M_thruster_2_3"]
