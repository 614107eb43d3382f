"""Stand-ins for effects with a shape: each is the effect at that shape, and the choice among them is paid for."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from auvnn.diagnosis.cut import windows_for
from auvnn.diagnosis.nuisance import lay_out
from auvnn.diagnosis.probes import extent_of, probed
from auvnn.diagnosis.score import score
from auvnn.effects import EFFECTS, Extent
from auvnn.metrics.free_run import initial_states
from auvnn.models import GreyBox, load
from auvnn.simulate import simulate
from auvnn.training.prediction_error import answers, reduce, set_parameters
from auvnn.training.sensitivity import respond

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
    sums, _, _ = reduce(
        windows, answers(whole, windows, initial_states(whole, windows), whole.effect_names), SIGMA
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
    sums, _, _ = reduce(windows, answers(whole, windows, initial, whole.effect_names), SIGMA)
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
