"""Stand-ins for effects with a shape: each is the effect at that shape, and the choice among them is paid for."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.score_tests.levers import OnLevers
from auvnn.diagnosis.score_tests.null_tests import NullTests
from auvnn.diagnosis.score_tests.probes import extent_of, probed
from auvnn.diagnosis.score_tests.score import Score, score
from auvnn.diagnosis.score_tests.shape_search import ShapeSearch, best_of, search_shapes
from auvnn.effects import EFFECTS, Extent
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.sensitivity import respond
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.metrics.free_run import initial_states
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate

SHAPED = [
    n
    for n in EFFECTS.names()
    if any(p.shape for p in EFFECTS.get(n).describe(load("rov95").vehicle, "wrench"))
]
SIGMA = np.array([0.05, 0.05, 0.01, 0.003, 0.003, 0.008, *[0.006] * 3, *[0.003] * 3, *[np.inf] * 6])


@pytest.fixture(scope="module")
def model():
    return load("rov95")


@pytest.fixture(scope="module")
def windows(model):
    made = simulate(
        model, "multisine", "realistic", runs=2, duration=6.0, rate=10.0, max_step=0.05, bottom=9.5
    )
    return windows_for(model, made.log)


def test_all_that_begin_swing_or_go_slack_have_a_shape():
    assert {"payload", "waves", "tether", "bottom_proximity"} <= set(SHAPED)


@pytest.mark.parametrize("name", SHAPED)
def test_each_stand_in_is_the_effect_at_that_shape(model, windows, name):
    asked = probed(lay_out(model, [name]), [name], extent_of(windows))
    first = windows.pick(slice(0, 1))
    initial = initial_states(model, first)
    whole = asked.layout.model
    together = respond(whole, first, initial, whole.effect_names).parameters
    kind = EFFECTS.get(name)
    labels = list(asked.starts[name])
    for label in {labels[0], labels[len(labels) // 2], labels[-1]}:
        alone = GreyBox(model.vehicle, [kind.build(model.vehicle, "thrusters", asked.starts[name][label])])
        live = [i for i, p in enumerate(alone.members[0].parameters_of) if not p.shape]
        expected = respond(alone, first, initial, [name]).parameters[..., live]
        found = together[..., torch.as_tensor(asked.layout.columns[label])]
        torch.testing.assert_close(found, expected, rtol=1e-8, atol=1e-10)


def test_the_best_of_several_is_paid_for(model, windows):
    asked = probed(lay_out(model, ["payload"]), ["payload"], extent_of(windows))
    whole = asked.layout.model
    sums, _, _ = normal_equations(
        windows, linearise(whole, windows, initial_states(whole, windows), whole.effect_names), SIGMA
    )
    each = [score(sums, asked.layout, [], label) for label in asked.starts["payload"]]
    best, label = asked.score(sums, [], "payload", ())
    seen = [s for s in each if s.degrees]
    assert len(seen) > 1
    assert best.p_value == pytest.approx(min(1.0, len(seen) * min(s.p_value for s in seen)))
    assert best.evidence <= max(s.evidence for s in seen)
    described = EFFECTS.get("payload").describe(model.vehicle, "thrusters")
    values = dict(zip([p.name for p in described], best.estimate, strict=True))
    assert values["time"] == asked.starts["payload"][label]["time"]
    assert np.isnan(best.std[[p.shape for p in described]]).all()


def test_a_hidden_load_is_found_at_the_time_nearest_to_its_own(model):
    hidden = {"payload": {"time": 9.0, "mass": 2.0, "buoyancy": 0.0}}
    made = simulate(model, "multisine", "realistic", hidden, runs=1, duration=16.0, rate=10.0, max_step=0.05)
    windows = windows_for(model, made.log)
    asked = probed(lay_out(model, ["payload"]), ["payload"], extent_of(windows))
    whole = asked.layout.model
    initial = initial_states(whole, windows)
    sums, _, _ = normal_equations(windows, linearise(whole, windows, initial, whole.effect_names), SIGMA)
    _, label = asked.score(sums, [], "payload", ())
    times = [s["time"] for s in asked.starts["payload"].values()]
    assert asked.starts["payload"][label]["time"] == min(times, key=lambda t: abs(t - 9.0))


def test_the_extent_is_that_of_the_log(windows):
    extent = extent_of(windows)
    assert isinstance(extent, Extent)
    assert (
        extent.begin == 0.0 and extent.duration == pytest.approx(6.0) and extent.longest == pytest.approx(6.0)
    )
    away = torch.linalg.vector_norm(windows.eta[..., :3], dim=-1)
    assert extent.distance[1] == pytest.approx(float(away.max()))


def test_what_is_absent_is_left_out_and_predicts_the_same(model, windows):
    effects = {
        "ocean_current": {"v_north": 0.2},
        "payload": {"time": 3.0},
        "velocity_scale": None,
        "waves": None,
    }
    whole = model.with_effects(effects)
    lean = whole.without_absent(["waves"])
    assert lean.effect_names == ["ocean_current", "waves"] and not lean.time_varying
    assert lean.members[0] is whole.effect("ocean_current")
    initial = initial_states(whole, windows)
    names = ["ocean_current", "waves"]
    a, b = (respond(m, windows.pick(slice(0, 1)), initial[:1], names) for m in (whole, lean))
    torch.testing.assert_close(a.error, b.error, rtol=1e-12, atol=1e-13)
    torch.testing.assert_close(a.parameters, b.parameters, rtol=1e-9, atol=1e-11)
    set_parameters(whole, ["velocity_scale"], np.array([1.01]))
    assert "velocity_scale" in whole.without_absent().effect_names


def test_a_load_off_the_centre_is_seen_by_what_it_turns(model):
    """At the centre it shows what it lifts alone; amounts and moments together hold it wherever it hangs."""
    load_ = {"time": 8.0, "mass": 0.0, "x": 0.15, "y": -0.2, "z": 0.0, "buoyancy": -0.6}
    made = simulate(
        model,
        "multisine",
        "realistic",
        {"payload": load_},
        seed=3,
        runs=4,
        duration=20.0,
        rate=10.0,
        max_step=0.05,
    )
    windows, layout = windows_for(model, made.log), lay_out(model, ["payload", "waves"])
    base = list(layout.nuisance)
    fit = fit_hypothesis(layout, windows, base, ())
    extent = extent_of(windows)
    search = search_shapes(layout, windows, fit, base)

    def at(shape):
        asked = probed(layout, ["payload"], extent, {"payload": [shape]})
        return asked.seen(windows, fit, base, "payload", [])

    far = probed(layout, ["payload"], extent).seen(windows, fit, base, "payload", [])
    on = search.on_levers("payload")
    joint = best_of(on)
    # One joint test for each of eight times, and what it takes away is no less than the effect does at any place.
    assert len(on) == 8 and abs(joint.shape["time"] - 8.0) < 1.5
    signs = ((0.15, -0.15, -0.15), (0.15, -0.15, 0.15))  # of eight corners those that the load is nearest to
    corners = [at({"time": joint.shape["time"], "x": x, "y": y, "z": z}) for x, y, z in signs]
    there = at(joint.shape)
    assert max(c.gain for c in corners) < joint.score.gain and far.gain < 0.5 * joint.score.gain
    # The place that follows from the sums is better than any of the corners. The inertia, square in it, is little.
    assert max(c.gain for c in corners) < there.gain < 1.001 * joint.score.gain
    assert joint.shape["x"] == pytest.approx(0.15, abs=0.05) and joint.shape["y"] == pytest.approx(
        -0.2, abs=0.05
    )
    assert search.on_levers("waves") == []
    # A search looks there as well, where it promises more than chance; the choice among the times is paid for.
    asked_for = NullTests(layout, windows, lambda words: None)(fit, ["payload"], base, [])
    seen = asked_for.scores["payload"]
    assert seen.gain > 2.0 * far.gain and seen.p_value < far.p_value and seen.degrees == joint.score.degrees
    again = search.on_levers("payload", [{"time": float(seen.estimate[0])}])[0].score
    paid = [8 * min(one.score.p_value for one in on), 8 * 16 * again.p_value]
    assert seen.p_value == pytest.approx(min(paid), rel=1e-3)
    # Whoever asks for a load starts from there. At that place other times have been looked at.
    values = search_shapes(layout, windows, fit, base).start("payload").model.effect("payload").values()
    assert 9.81 * values["mass"] - values["buoyancy"] == pytest.approx(0.6, rel=0.2)
    assert values["x"] == pytest.approx(0.15, abs=0.05) and abs(values["time"] - 8.0) < 0.3


def test_what_acts_on_a_lever_is_looked_at_where_it_promises_most_or_leads(model, windows, monkeypatch):
    """An effect of rough errors may promise more than the one that the test is surer of."""
    layout = lay_out(model, ["payload", "constant_force", "waves"])
    tests = NullTests(layout, windows, lambda words: None)

    def score_of(effect, p_value, gain, evidence):
        return Score(effect, p_value, gain, 8, 1.0, np.zeros(8), np.ones(8), evidence, gain)

    looked, joint = [], [score_of("payload", 1e-9, 200.0, 50.0)]
    monkeypatch.setattr(ShapeSearch, "look", lambda self, name, seen: looked.append(name))
    monkeypatch.setattr(ShapeSearch, "near", lambda self, name, plain: None)

    def closer():
        search = ShapeSearch(layout, windows, None, [], [], tests.extent)
        return tests._closer(search, scores, {"payload": [OnLevers(joint[0], {})]})

    scores = {
        "payload": score_of("payload", 0.5, 9.0, -5.0),
        "constant_force": score_of("constant_force", 1e-6, 240.0, 5.0),
    }
    assert closer() == {} and looked == ["payload"]
    # Where it neither promises most nor leads, it is not; nor where chance does as much.
    looked.clear()
    joint[0] = score_of("payload", 1e-9, 200.0, 4.0)
    assert closer() == {} and looked == []
    scores["constant_force"] = score_of("constant_force", 0.5, 5.0, -3.0)
    assert closer() == {} and looked == ["payload"]
    looked.clear()
    joint[0] = score_of("payload", 0.1, 12.0, -3.0)
    assert closer() == {} and looked == []


def test_an_onset_is_looked_for_until_a_fit_would_find_it(model):
    """In a log of ten minutes the first times asked for are 75 s apart."""
    kind = EFFECTS.get("payload")
    described = kind.describe(model.vehicle, "thrusters")
    extent = Extent(0.0, 600.0, 600.0, (0.0, 0.0))
    for true in (3.0, 217.3, 301.0, 599.0):
        near = min(kind.starts(described, extent), key=lambda s: abs(s["time"] - true))
        level = 0
        while around := kind.closest(described, extent, {**near, "x": 0.3}, level):
            assert all(s["x"] == 0.3 and 0.0 <= s["time"] <= 600.0 for s in around)
            near, level = min(around, key=lambda s: abs(s["time"] - true)), level + 1
        assert abs(near["time"] - true) < 0.6 and level == 3


def test_a_time_before_zero_is_asked_for_at_zero(model, windows):
    """The clock of a log that jitters begins a few milliseconds early."""
    name = "payload"
    asked = probed(
        lay_out(model, [name]), [name], extent_of(windows), {name: [{"time": -0.003}, {"time": 2.0}]}
    )
    assert [s["time"] for s in asked.starts[name].values()] == [0.0, 2.0]
