"""add(): what an effect brings on data that were held out, what is refused, what is reported with it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.cross_validation.fitters import fitter_for
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.errors import ConfigError, InputError
from auvnn.improvement import add
from auvnn.logs import Log, Run
from auvnn.metrics.rollouts import rollout_table, scale_of
from auvnn.models import GreyBox, load, remove
from auvnn.testing import make_scene, plain_vehicle
from tests.diagnosis.strange_effects import HeavePush, listed
from tests.small_logs import make_log, sines, small_vehicle

CURRENT = {"v_north": 0.15, "v_east": -0.10}
GROUPS = ("added_mass", "linear_damping", "quadratic_damping", "inertia")
# What the plant has beside the current: within the stated ten per cent.
DRAWN = {"linear_damping": {"X": 1.12, "Y": 0.9, "Z": 1.1, "K": 0.92, "M": 1.08, "N": 0.88}}


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


@pytest.fixture(scope="module")
def logs(model):
    """What is fitted, and what is held out: the same plant, other manoeuvres."""
    truth = model.with_effects({"ocean_current": CURRENT, **DRAWN})
    whole = make_log(truth, runs=4, duration=12.0, noise=1.0)
    return whole.select([0, 1, 2]), whole.select([3]), truth


@pytest.fixture(scope="module")
def added(model, logs):
    log, test, _ = logs
    return add(model, log, "ocean_current", test=test)


def total(model, test, horizon="5"):
    return rollout_table(model, test, scale_of(test), (horizon,))[0][horizon]["total"]


def test_a_missing_current_is_accepted_with_its_parameters(added):
    assert added.accepted and added.gain["value"] > 5 * added.gain["std"] > 0
    for name, value in {**CURRENT, "v_down": 0.0}.items():
        p = added.parameters["ocean_current"][name]
        assert abs(p["value"] - value) < 4 * p["std"] and p["std"] < 0.02 and p["unit"] == "m/s"


def test_every_figure_is_that_of_its_model_on_the_held_out_log(added, model, logs):
    _, test, _ = logs
    for stage, of in (("before", model), ("refitted", added.refitted_model), ("after", added.model)):
        assert getattr(added, stage)["rollout"]["5"]["total"] == pytest.approx(total(of, test), rel=1e-9), (
            stage
        )
        assert set(getattr(added, stage)) == {"one_step", "rollout"}
    assert added.gain["value"] == pytest.approx(
        total(added.refitted_model, test) - total(added.model, test), rel=1e-6
    )


def test_the_waterfall_falls_to_the_noise_floor(added):
    steps = [s["step"] for s in added.waterfall]
    errors = [s["error"] for s in added.waterfall]
    assert steps == ["as given", "coefficients refitted", "ocean_current", "noise floor"]
    assert (
        errors[0] > 0.95 * errors[1]
        and errors[1] > 3 * errors[2]
        and errors[2] == pytest.approx(errors[3], rel=0.3)
    )
    assert (
        errors[0] == added.before["rollout"]["5"]["total"]
        and errors[2] == added.after["rollout"]["5"]["total"]
    )


def test_the_held_out_error_comes_within_a_tenth_of_the_true_models(added, logs):
    _, test, truth = logs
    assert added.after["rollout"]["5"]["total"] == pytest.approx(total(truth, test), rel=0.1)


def test_the_answer_has_the_contracts_keys(added, logs):
    log, test, _ = logs
    answer = json.loads(json.dumps(added.to_dict(), allow_nan=False))
    assert answer["schema"] == "auvnn/improvement/1"
    assert {
        "model",
        "log",
        "test",
        "effects",
        "accepted",
        "before",
        "refitted",
        "after",
        "gain",
        "waterfall",
        "parameters",
    } <= set(answer)
    assert (answer["log"], answer["test"], answer["effects"]) == (log.name, test.name, ["ocean_current"])
    assert set(answer["gain"]) == {"value", "std"}
    assert [s["run"] for s in added.series] == [3]
    np.testing.assert_array_equal(added.series[0]["measured"], test.runs[0].nu)


def test_the_model_that_was_given_is_not_changed_and_the_new_one_holds_the_effect(added, model):
    assert model.effect_names == [] and added.model.effect_names == ["ocean_current"]
    assert added.refitted_model.effect_names == []
    values = {n: p["value"] for n, p in added.parameters["ocean_current"].items()}
    assert added.model.effect("ocean_current").values() == pytest.approx(values, rel=1e-12)


def test_refitted_coefficients_are_baked_into_the_vehicles_own_numbers(added, model):
    assert set(added.coefficients) == set(GROUPS)
    for name, matrix in (
        ("added_mass", "added_mass"),
        ("linear_damping", "linear_damping"),
        ("quadratic_damping", "quadratic_damping"),
    ):
        factor = [added.coefficients[name][a]["value"] for a in "XYZKMN"]
        np.testing.assert_allclose(
            np.diag(getattr(added.model.vehicle, matrix)),
            np.diag(getattr(model.vehicle, matrix)) * factor,
            rtol=1e-9,
        )
    factor = [added.coefficients["inertia"][a]["value"] for a in "KMN"]
    np.testing.assert_allclose(
        np.diag(added.model.vehicle.inertia), np.diag(model.vehicle.inertia) * factor, rtol=1e-9
    )
    # And they went the right way.
    for axis, true in DRAWN["linear_damping"].items():
        found = added.coefficients["linear_damping"][axis]
        assert abs(found["value"] - true) < 4 * found["std"] < 0.4


def test_without_the_effect_the_rest_stays_as_it_was_refitted(added, model):
    bare = remove(added.model, "ocean_current")
    assert bare.effect_names == []
    scene = make_scene(model.vehicle, "thrusters")
    expected = GreyBox(added.model.vehicle)(scene.eta, scene.nu, scene.inputs.command[:, 0])
    torch.testing.assert_close(bare(scene.eta, scene.nu, scene.inputs.command[:, 0]), expected)
    still = {n: dict.fromkeys(("v_north", "v_east", "v_down"), 0.0) for n in ["ocean_current"]}
    null = bare.with_effects(still)(scene.eta, scene.nu, scene.inputs.command[:, 0])
    torch.testing.assert_close(null, expected)


def test_a_saved_model_predicts_the_same(added, logs, tmp_path):
    _, test, _ = logs
    again = load(added.model.save(tmp_path / "better"))
    assert again.effect_names == ["ocean_current"]
    assert total(again, test, "2") == pytest.approx(total(added.model, test, "2"), rel=1e-9)


def test_a_model_on_which_nothing_is_missing_gains_nothing_by_an_effect(model):
    log = make_log(model, runs=4, duration=10.0, noise=1.0, seed=4)
    found = add(model, log, "velocity_lever_arm")
    assert not found.accepted
    assert any(w.startswith("not accepted: the held-out error falls by") for w in found.warnings)
    assert found.held_out.startswith("run 3, the last of") and found.test == log.name
    assert abs(found.gain["value"]) < 0.1 * found.before["rollout"]["5"]["total"]


def test_two_effects_are_two_steps_of_the_waterfall_even_on_a_short_test(model):
    truth = model.with_effects({"ocean_current": CURRENT, "net_buoyancy": {"force": 6.0}})
    log = make_log(truth, runs=3, duration=10.0, noise=1.0)
    test = make_log(truth, runs=1, duration=3.0, noise=1.0, first=7)
    found = add(model, log, ["ocean_current", "net_buoyancy"], test=test)
    assert [s["step"] for s in found.waterfall] == [
        "as given",
        "coefficients refitted",
        "ocean_current",
        "net_buoyancy",
        "noise floor",
    ]
    errors = [s["error"] for s in found.waterfall]
    assert errors[1] > errors[2] > errors[3] > 0.5 * errors[4]
    assert any(
        "no held-out stretch is 5 s long: gain and waterfall are for horizon 2" in w for w in found.warnings
    )
    assert errors[3] == found.after["rollout"]["2"]["total"] and found.after["rollout"]["5"]["total"] is None
    assert found.parameters["net_buoyancy"]["force"]["value"] == pytest.approx(6.0, rel=0.1)


def test_what_cannot_be_added_is_refused(model, logs):
    log, test, _ = logs
    with pytest.raises(ConfigError, match="named twice"):
        add(model, log, ["ocean_current", "ocean_current"], test=test)
    with pytest.raises(ConfigError, match=r"no effect called 'curent'"):
        add(model, log, "curent", test=test)
    with pytest.raises(
        ConfigError, match="the model has ocean_current already: refit=true fits it anew; or remove"
    ):
        add(model.with_effects(["ocean_current"]), log, "ocean_current", test=test)
    with pytest.raises(ConfigError, match="no effect to add"):
        add(model, log, [], test=test)


def test_data_on_both_sides_are_refused_under_any_name(model, logs):
    log, _test, _ = logs
    with pytest.raises(InputError, match=r"shares .* samples with the log"):
        add(model, log, "ocean_current", test=log.select([1]))
    run = log.runs[2]
    renamed = Log.from_runs(
        [Run(17, run.t[20:] + 5.0, run.quaternion[20:], run.nu[20:], thrusters=run.thrusters[20:])],
        name="another dive",
    )
    with pytest.raises(InputError, match="another dive"):
        add(model, log, "ocean_current", test=renamed)


def test_thrusters_at_neutral_say_nothing_about_thrusters(model):
    log = make_log(
        model.with_effects({"net_buoyancy": {"force": 5.0}}),
        runs=3,
        duration=8.0,
        noise=1.0,
        command=np.zeros((81, 8)),
    )
    with pytest.raises(
        InputError, match=r"says nothing about thruster_lag.time_constant: .* leave thruster_lag out"
    ):
        add(model, log, "thruster_lag")
    with pytest.raises(InputError, match=r"thruster_gain.thruster_1, .*thruster_gain.thruster_8"):
        add(model, log, ["net_buoyancy", "thruster_gain"])


def test_one_thruster_at_neutral_is_named_and_has_no_standard_error(model):
    t = np.arange(0, 8.05, 0.1)
    command = 0.4 * sines(t, 8, 5)
    command[:, 2] = 0.0
    log = make_log(
        model.with_effects({"thruster_gain": {"thruster_1": 0.8}}),
        runs=3,
        duration=8.0,
        noise=1.0,
        command=command,
    )
    found = add(model, log, "thruster_gain")
    gains = found.parameters["thruster_gain"]
    assert any(
        "says nothing about thruster_gain.thruster_3: they stay near where they were" in w
        for w in found.warnings
    )
    assert np.isnan(gains["thruster_3"]["std"]) and gains["thruster_3"]["value"] == pytest.approx(
        1.0, abs=1e-6
    )
    assert found.to_dict()["parameters"]["thruster_gain"]["thruster_3"]["std"] is None
    assert abs(gains["thruster_1"]["value"] - 0.8) < 4 * gains["thruster_1"]["std"] < 0.2


def test_parameters_that_cannot_be_told_apart_are_named(monkeypatch):
    """Up is up, by buoyancy or by a push, as long as the vehicle stays level: row 88 of a list of what goes wrong."""
    listed(monkeypatch, HeavePush)
    vehicle = plain_vehicle(
        linear_damping=[25, 35, 40, 4, 5, 5],
        quadratic_damping=[40, 60, 80, 4, 5, 6],
        uncertainty=dict.fromkeys(GROUPS, 0.0),
    )
    model = GreyBox(vehicle, actuation="wrench")
    t = np.arange(0, 8.05, 0.1)
    log = make_log(
        model.with_effects({"net_buoyancy": {"force": 6.0}}),
        runs=3,
        duration=8.0,
        noise=1.0,
        command=sines(t, 6, 3) * [0, 0, 15.0, 0, 0, 3.0],
        stir=0.0,
    )
    found = add(model, log, ["net_buoyancy", "heave_push"])
    assert any(
        "net_buoyancy.force and heave_push.force cannot be told apart on this log (correlation " in w
        for w in found.warnings
    )
    stds = [found.parameters[n]["force"]["std"] for n in ("net_buoyancy", "heave_push")]
    # Each alone is as good as unknown, and says so; their difference is what was hidden.
    assert min(stds) > 6.0
    values = [found.parameters[n]["force"]["value"] for n in ("net_buoyancy", "heave_push")]
    assert values[0] - values[1] == pytest.approx(6.0, rel=0.1)


def test_a_parameter_that_ends_at_its_bound_is_reported(model):
    """A vehicle without linear damping, described as one that has it: the factor would have to be zero."""
    bare = {"linear_damping": [1e-6] * 6, "quadratic_damping": [40.0, 60.0, 80.0, 4.0, 5.0, 6.0]}
    log = make_log(GreyBox(small_vehicle(**bare)), runs=3, duration=8.0, size=0.5)
    found = add(GreyBox(small_vehicle(0.0)), log, "linear_damping")
    assert found.parameters["linear_damping"]["X"]["value"] == 0.01
    assert any("linear_damping.X ended at its bound 0.01: the data ask for more" in w for w in found.warnings)
    assert found.accepted


def test_a_bound_that_is_the_null_is_no_news(model):
    runs = make_log(model, runs=3, duration=6.0, noise=1.0).runs
    # Commands written down a sample late: a lag would have to be negative.
    late = Log.from_runs(
        [Run(r.number, r.t[1:], r.quaternion[1:], r.nu[1:], thrusters=r.thrusters[:-1]) for r in runs]
    )
    found = add(model, late, "thruster_lag")
    assert found.parameters["thruster_lag"]["time_constant"]["value"] == 0.0 and not found.accepted
    assert not any("ended at its bound" in w for w in found.warnings)


def test_one_step_errors_find_the_current_too_and_say_what_runs_left_out_make_of_it(model, logs):
    log, test, _ = logs
    better = add(model, log, "ocean_current", test=test, objective="one_step", derivative={"half_width": 3})
    found = better.parameters["ocean_current"]
    assert all(abs(found[n]["value"] - v) < 0.03 for n, v in CURRENT.items())
    assert better.accepted and better.left_out["gain"] > 3 * better.left_out["std"] > 0
    assert better.left_out["before"] - better.left_out["after"] == pytest.approx(better.left_out["gain"])
    assert better.to_dict()["objective"] == "one_step"


def test_a_fit_one_step_ahead_leaves_spikes_out_as_the_warning_says(model):
    """To the last digit as if the sample were missing."""
    run = make_log(
        model.with_effects({"net_buoyancy": {"force": 6.0}}), runs=1, duration=10.0, noise=0.3
    ).runs[0]
    fits = []
    for value in (run.nu[40, 2] + 0.6, np.nan):
        nu = run.nu.copy()
        nu[40, 2] = value
        log = Log.from_runs([replace(run, nu=nu)])
        fitter = fitter_for(model, log, "one_step")
        found = fitter.fit(lay_out(model, ["net_buoyancy"]), [], ["net_buoyancy"], None)
        fits.append(found.fitted.theta)
    assert fits[0] == pytest.approx(fits[1], rel=1e-9) and fits[0] == pytest.approx(6.0, abs=0.5)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"objective": "two_step"}, "objective"), ({"objective": "one_step", "window": 2.0}, "window= belongs")],
)
def test_objectives_that_do_not_exist_or_do_not_fit_are_refused(model, logs, options, words):
    with pytest.raises(ConfigError, match=words):
        add(model, logs[0], "ocean_current", test=logs[1], **options)
