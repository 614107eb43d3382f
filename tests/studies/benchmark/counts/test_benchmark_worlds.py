"""Logs of other worlds in the benchmark: balanced plans, effects of a stated cost, and one log all the way."""

from __future__ import annotations

import json
from collections import Counter
from typing import Any

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from auvnn.effects import EFFECTS, Sensed
from auvnn.effects.sizes import usual_speeds
from auvnn.errors import ConfigError
from auvnn.models import load
from auvnn.plants.independent.hull import curved
from auvnn.plants.laws import Laws
from auvnn.simulation import simulate
from auvnn.simulation.noise import make_noise
from auvnn.simulation.worlds import make_world
from auvnn.simulation.worlds.sensing import Sensing
from auvnn.studies.benchmark import cases, run_case
from auvnn.studies.benchmark.case import Case
from auvnn.studies.benchmark.cases import targets
from auvnn.studies.benchmark.costs import cost_of, costly
from auvnn.studies.benchmark.counts.rates import NUMBERS, RATES, z_of
from auvnn.studies.benchmark.counts.worlds import own_amounts
from tests.studies.benchmark.plans import OPTIONS, of_plan

WORLDS = ("between", "disturbed", "shaped", "sensors", "conventions", "everything")


def test_the_blind_plan_has_every_effect_at_every_cost_in_every_world():
    options, found = of_plan("worlds")
    assert len({(c.part, c.seed) for c in found}) == len(found)
    for world in WORLDS:
        hidden = [c for c in found if c.part == world]
        by_effect = Counter(c.hidden for c in hidden)
        assert set(by_effect.values()) == {3} and len(by_effect) >= 39
        assert all({c.size for c in hidden if c.hidden == n} == {"15%", "40%", "150%"} for n in by_effect)
        nothing = [c for c in found if c.part == f"{world}_nothing"]
        assert len(nothing) == 40 and {c.kind for c in nothing} == {"nothing"}
        for logs in (hidden, nothing):
            loops = Counter(c.loop for c in logs)
            assert abs(loops["open"] - loops["closed"]) < 0.2 * len(logs)
            assert min(Counter(c.vehicle for c in logs).values()) > 0.25 * len(logs)
    assert {c.world for c in found if c.part == "disturbed"} == {"disturbed_10", "disturbed_25"}
    assert {c.rate for c in found if c.part == "between"} == {20.0, 5.0}
    assert {t["rate"] for t in targets(options)} <= {*RATES, *NUMBERS}


def test_the_logs_on_which_rules_are_made_are_others():
    (_, blind), (_, made) = of_plan("worlds"), of_plan("worlds_made")
    assert not {c.seed for c in blind} & {c.seed for c in made}
    for world in WORLDS:
        assert len([c for c in made if c.part == f"{world}_nothing"]) == 10
        assert 25 <= len([c for c in made if c.part == world]) <= 30


def test_what_an_effect_gets_follows_from_its_name_alone():
    part = {"balanced": 3, "costs": [0.15, 0.4, 1.5], "vehicles": ["rov95", "remus100"], "loops": ["open", "closed"],
            "plants": "numpy", "worlds": "shaped"}  # fmt: skip
    one = cases({**OPTIONS, **part, "effects": ["net_buoyancy"]})
    more = cases({**OPTIONS, **part, "effects": ["fin_stall", "net_buoyancy"]})
    assert one == [c for c in more if c.hidden == "net_buoyancy"]
    assert {c.vehicle for c in more if c.hidden == "fin_stall"} == {"remus100"}
    assert {c.excitation for c in one} == {"multisine", "survey"}
    with pytest.raises(ConfigError, match="fin_stall can be hidden in none of rov95"):
        cases({**OPTIONS, **part, "vehicles": "rov95", "effects": "fin_stall"})
    with pytest.raises(ConfigError, match="costs= is needed"):
        cases({**OPTIONS, **part, "costs": None, "effects": "net_buoyancy"})


@pytest.mark.parametrize("cost", [0.4, 1.5])
def test_an_effect_costs_what_it_was_asked_for(cost):
    model = load("rov95")
    how: dict[str, Any] = dict(excitation="multisine", noise="realistic", rate=20.0, plant="numpy")
    values = costly(model, "constant_force", cost, seed=4, runs=2, duration=10.0, world="disturbed_10", **how)
    log = simulate(
        model, hidden={"constant_force": values}, seed=4, runs=2, duration=10.0, max_step=0.025, world="disturbed_10",
        **how,
    ).log  # fmt: skip
    assert cost_of(model, log, {"constant_force": values}) == pytest.approx(cost, rel=0.2)


def test_one_log_of_a_world_goes_the_whole_way():
    part = {"balanced": 1, "costs": [1.5], "loops": ["open"], "plants": "numpy", "worlds": "disturbed_10", "oracle": True,
            "effects": ["net_buoyancy"], "candidates": ["net_buoyancy", "constant_force"], "duration": 10.0}  # fmt: skip
    (case,) = cases({**OPTIONS, **part})
    row = run_case(case)
    assert row["fault"] is None and row["size"] == "150%" and 0.7 < row["cost"] < 3.0
    seen = row["oracle_distances"]["net_buoyancy"]
    assert seen["nothing"] > seen["constant_force"] > 0.0
    # By what a row says its case is found again, and the log is not made twice.
    assert {Case.of_row(json.loads(json.dumps(row, default=float))): 1} == {case: 1}
    assert np.shape(row["world_law"]["drawn"]["force"]["rms"]) == (6,)


def test_a_hidden_tilt_and_that_of_the_world_are_one():
    # What the world's sensors make of what the effect reports, as one rotation; what is about the vertical is no tilt.
    hidden, std, chance = np.array([0.17, -0.08]), 0.001, [np.random.default_rng(5)]
    sensing = Sensing(
        make_world({"sensors": {"tilt": 0.006}}).sensors,
        make_noise("none"),
        0.05,
        3,
        chance,
        chance,
        chance[0],
    )
    effect = EFFECTS.get("tilted_vertical").build(
        load("rov95").vehicle, "thrusters", dict(zip(("north", "east"), hidden.tolist(), strict=True))
    )
    true, zero = Rotation.from_euler("ZYX", [0.9, 0.3, -0.2]), torch.zeros(6, dtype=torch.float64)
    x, y, z, w = true.as_quat()
    seen = effect.sense(Sensed(zero[:3], torch.tensor([w, x, y, z]), zero)).quaternion.detach().numpy()
    w, x, y, z = sensing.turned(seen[None])[0]
    both, world = (Rotation.from_quat([x, y, z, w]) * true.inv()).as_rotvec()[:2], sensing.tilt
    errors = {n: {"relative": 0.0, "z": (both[i] - hidden[i]) / std} for i, n in enumerate(("north", "east"))}
    row = {"kind": "effect", "hidden": "tilted_vertical", "effects": ["tilted_vertical"], "verdict": "named",
           "missing": ["tilted_vertical"], "found": [{"verdict": "named", "effects": ["tilted_vertical"]}],
           "parameters": {n: {"value": both[i], "std": std} for i, n in enumerate(("north", "east"))}, "errors": errors,
           "world_law": {"drawn": {"tilt": world.tolist()}}}  # fmt: skip
    assert np.abs(z_of(row)).max() < 0.1 < 2.0 < np.abs([e["z"] for e in errors.values()]).max()
    # Of another effect nothing is taken off.
    name = ["gyro_bias"]
    other = {
        **row,
        "hidden": name[0],
        "effects": name,
        "missing": name,
        "found": [{"verdict": "named", "effects": name}],
    }
    assert z_of(other) == [e["z"] for e in errors.values()]


def test_hidden_exponents_of_the_drag_and_those_of_the_world_are_one():
    # As the plant puts them together.
    vehicle = load("rov95").vehicle
    world, hidden = (
        np.array([1.8, 2.1, 1.9, 2.2, 1.75, 2.0]),
        dict(zip("XYZKMN", [1.5, 2.4, 2.0, 2.2, 1.7, 2.6], strict=True)),
    )
    law = curved(Laws(exponent=world, speed=np.full(6, 0.5)), vehicle, {"drag_curve": hidden})
    row = {"kind": "effect", "hidden": "drag_curve", "effects": ["drag_curve"],
           "world_law": {"drawn": {"tilt": [0.0, 0.0], "exponent": world.tolist()}}}  # fmt: skip
    own = own_amounts(row)
    assert [hidden[a] + own[a] for a in "XYZKMN"] == pytest.approx(np.asarray(law.exponent).tolist())
    assert np.allclose(law.speed, usual_speeds(vehicle)), "the speeds at which the effect's powers agree"
    assert own_amounts({**row, "hidden": "payload", "effects": ["payload"]}) == {}
