"""Effects that one log cannot tell apart are given as a group, and looked at again with what was found since."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.residuals.additive_force_test import AdditiveForce
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.effects import effect_class
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle
from tests.diagnosis.strange_effects import HeadingForce, HeavePush, listed
from tests.small_logs import make_log, sines, small_vehicle


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def by_name(found):
    return {c["effect"]: c for c in found.candidates}


@pytest.fixture
def level(monkeypatch):
    """A vehicle that stays level, pushed up by 6 N, and a second name for that in the catalogue."""
    listed(monkeypatch, HeavePush)
    vehicle = plain_vehicle(
        linear_damping=[25, 35, 40, 4, 5, 5],
        quadratic_damping=[40, 60, 80, 4, 5, 6],
        uncertainty=dict.fromkeys(("added_mass", "linear_damping", "quadratic_damping", "inertia"), 0.1),
    )
    model = GreyBox(vehicle, actuation="wrench")
    t = np.arange(0, 10.05, 0.1)
    command = sines(t, 6, 3) * [0, 0, 15.0, 0, 0, 3.0]
    return model, make_log(
        model.with_effects({"net_buoyancy": {"force": 6.0}}),
        runs=3,
        duration=10.0,
        noise=1.0,
        command=command,
        stir=0.0,
    )


def test_two_names_for_the_same_thing_are_given_as_a_group(level):
    model, log = level
    found = diagnose(model, log, ["net_buoyancy", "heave_push", "thruster_lag"], advice=False)
    assert found.verdict == "ambiguous" and set(found.missing) == {"net_buoyancy", "heave_push"}
    assert [(s["verdict"], set(s["effects"])) for s in found.steps] == [
        ("ambiguous", {"net_buoyancy", "heave_push"}),
        ("adequate", set()),
    ]
    twins = by_name(found)
    for a, b in (("net_buoyancy", "heave_push"), ("heave_push", "net_buoyancy")):
        assert {"effect": b, "similarity": pytest.approx(1, abs=0.01)} in twins[a]["confusable_with"]
    assert twins["net_buoyancy"]["parameters"]["force"]["value"] == pytest.approx(6.0, rel=0.1)
    assert twins["heave_push"]["parameters"]["force"]["value"] == pytest.approx(-6.0, rel=0.1)
    assert any("cannot tell which" in line for line in found.story)


@pytest.mark.parametrize("lift", [3.0, 9.0])
def test_a_group_does_not_end_the_search_and_is_looked_at_again_beside_what_came_after(
    level, monkeypatch, lift
):
    """Once the second effect is in the model, 9 N tell the vertical of the body from that of the world; 3 N do not."""
    model, _ = level
    listed(monkeypatch, HeavePush, HeadingForce)
    t = np.arange(0, 10.05, 0.1)
    truth = [
        effect_class(n).build(model.vehicle, "wrench", {"force": f})
        for n, f in (("net_buoyancy", lift), ("heading_force", 1.5))
    ]
    log = make_log(
        model.rebuilt(truth),
        runs=3,
        duration=10.0,
        noise=1.0,
        command=sines(t, 6, 3) * [0, 0, 15.0, 0, 0, 6.0],
        stir=0.0,
    )
    group, verdict = {"net_buoyancy", "heave_push"}, "named" if lift > 5.0 else "ambiguous"
    if verdict == "named":
        group.discard("heave_push")
    # In the order of the search, not of what each costs.
    names = ["net_buoyancy", "heave_push", "heading_force"]
    found = diagnose(model, log, names, advice=False, whiteness=False, costs=False)
    assert [(s["verdict"], set(s["effects"])) for s in found.steps] == [
        (verdict, group),
        ("named", {"heading_force"}),
        ("adequate", set()),
    ]
    # The contract: of a leading group the members, of names all of them.
    assert found.verdict == verdict and set(found.missing) == group | (
        {"heading_force"} if lift > 5.0 else set()
    )
    assert any(line.startswith("Missing: heading_force") for line in found.story)
    told = {n: c["parameters"]["force"] for n, c in by_name(found).items() if n in {*group, "heading_force"}}
    for name, force in (("net_buoyancy", lift), ("heading_force", 1.5)):
        assert abs(told[name]["value"] - force) < 4 * told[name]["std"] < 1.0
    if verdict == "ambiguous":
        assert abs(told["heave_push"]["value"] + lift) < 0.3


def test_a_group_that_had_stood_in_is_withdrawn_with_all_its_members(level, monkeypatch):
    """As if the group were not needed once the second effect is there: what leads then is that effect."""
    model, _ = level
    listed(monkeypatch, HeavePush, HeadingForce)
    t = np.arange(0, 10.05, 0.1)
    truth = [
        effect_class(n).build(model.vehicle, "wrench", {"force": f})
        for n, f in (("net_buoyancy", 9.0), ("heading_force", 3.0))
    ]
    log = make_log(
        model.rebuilt(truth),
        runs=3,
        duration=10.0,
        noise=1.0,
        command=sines(t, 6, 3) * [0, 0, 15.0, 0, 0, 6.0],
        stir=0.0,
    )

    def gone(self, taken, base):
        return fit_hypothesis(self.layout, self.windows, base, taken.effects[1:]), [taken.effects[0]]

    monkeypatch.setattr(Chooser, "withdrawn", gone)
    # What is left without the group is no stand-in here, but the purpose.
    monkeypatch.setattr("auvnn.diagnosis.stages.what_is_left.PARTIAL", 2.0)
    monkeypatch.setattr(
        "auvnn.diagnosis.stages.what_is_left.additive_force_test", lambda *_: AdditiveForce("X", "u", 1.0, ())
    )
    names = ["net_buoyancy", "heave_push", "heading_force"]
    found = diagnose(model, log, names, advice=False, whiteness=False, stochastic=False)
    assert [s["verdict"] for s in found.steps][:3] == ["ambiguous", "named", "withdrawn"]
    assert set(found.steps[2]["effects"]) == {"net_buoyancy", "heave_push"}
    assert (found.verdict, found.missing) == ("named", ["heading_force"])
    assert found.explanation.effects == ("heading_force",)


def test_the_same_two_names_are_told_apart_once_the_vehicle_tilts(monkeypatch, model):
    listed(monkeypatch, HeavePush)
    log = make_log(
        model.with_effects({"net_buoyancy": {"force": 12.0}}), runs=3, duration=10.0, noise=1.0, size=1.5
    )
    found = diagnose(model, log, ["net_buoyancy", "heave_push"], whiteness=False)
    assert (found.verdict, found.missing) == ("named", ["net_buoyancy"])
