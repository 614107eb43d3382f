"""What a name costs where the model states how uncertain the same numbers are, against fits that hold them as stated."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.rounds.free_running_cost import cost_of_name, free_running_cost
from auvnn.metrics.rollouts import scale_of
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

CANDIDATES = ["linear_damping", "net_buoyancy", "thruster_gain"]


@pytest.fixture(scope="module")
def world() -> SimpleNamespace:
    """A drag three stated deviations off, and a buoyancy, in a log with little noise."""
    drag = dict.fromkeys("XYZKMN", 1.3)
    return world_of({"linear_damping": drag, "net_buoyancy": {"force": 6.0}})


def world_of(hidden: dict[str, dict[str, float]]) -> SimpleNamespace:
    """Return a log with something hidden, and what fits effects to it."""
    model = GreyBox(small_vehicle(0.1))
    log = make_log(model.with_effects(hidden), noise=0.01)
    layout = lay_out(model, CANDIDATES)
    windows, base = windows_for(model, log), list(layout.nuisance)

    def fitted(base: list[str], effects: list[str], sigma: Any = None) -> Any:
        explanation = fit_hypothesis(layout, windows, base, effects, sigma=sigma)
        name = effects[-1] if effects else ""
        return SimpleNamespace(explanation=explanation, weighed=explanation, name=name)

    return SimpleNamespace(layout=layout, log=log, scale=scale_of(log), base=base, fitted=fitted)


def model_of(found: Any) -> GreyBox:
    return found.explanation.fitted.model.without_absent(found.explanation.effects)


def test_a_name_that_is_uncertain_anyway_costs_what_it_does_with_these_numbers_as_stated(world):
    after = world.fitted(world.base, ["net_buoyancy", "linear_damping"])
    before = world.fitted(world.base, ["net_buoyancy"])
    assert "linear_damping" in before.explanation.names
    taken_up = free_running_cost(model_of(after), model_of(before), world.log, world.scale).error
    found = cost_of_name(world.layout, after, before, world.log, world.scale)
    cost, moved = found.error, found.moves
    others = [n for n in world.base if n != "linear_damping"]
    held = world.fitted(others, ["net_buoyancy"], after.explanation.fitted.sigma)
    exact = free_running_cost(model_of(after), model_of(held), world.log, world.scale).error
    assert cost == pytest.approx(exact, rel=0.3)
    assert cost > 3.0 * abs(taken_up) and cost > 0.1 and moved > 0.05


def test_any_other_name_costs_what_the_hypothesis_without_it_loses(world):
    after, before = world.fitted(world.base, ["net_buoyancy"]), world.fitted(world.base, [])
    expected = free_running_cost(model_of(after), model_of(before), world.log, world.scale)
    assert cost_of_name(world.layout, after, before, world.log, world.scale) == expected
    assert expected.error > 0.1 and np.isfinite([expected.error, expected.typical, expected.moves]).all()


def test_a_name_that_shows_may_cost_what_it_does_with_everything_else_as_it_is():
    """Masses and drag that are uncertain anyway take up a part of a thrust that is too small."""
    gains = {f"thruster_{k + 1}": 0.8 for k in range(GreyBox(small_vehicle()).actuators.size)}
    world = world_of({"thruster_gain": gains})
    after, before = world.fitted(world.base, ["thruster_gain"]), world.fitted(world.base, [])
    model = model_of(after)
    without = model.rebuilt([e for e in model.copied_effects() if e.name != "thruster_gain"])
    alone = free_running_cost(model, without, world.log, world.scale)
    refitted = cost_of_name(world.layout, after, before, world.log, world.scale)
    assert alone.least > 2.0 * refitted.least > 0.0
    found = cost_of_name(world.layout, after, before, world.log, world.scale, others_stay=True)
    assert found.error == pytest.approx(alone.error, rel=1e-6) and found.moves == pytest.approx(
        alone.moves, rel=1e-6
    )
