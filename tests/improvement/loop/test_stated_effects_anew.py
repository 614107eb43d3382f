"""The loop fits effects anew that the model has, where the log contradicts what the model says of them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

import auvnn
from auvnn.improvement.loop import causes
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.screen import wanted
from auvnn.improvement.loop.state import Recipe
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

CURRENT = {"v_north": -0.15, "v_east": 0.2}


def model(v_north, v_east):
    made = GreyBox(small_vehicle()).with_effects({"ocean_current": {"v_north": v_north, "v_east": v_east}})
    made.effect("ocean_current").state_uncertainty({"v_north": 1e-4, "v_east": 1e-4, "v_down": 1e-4})
    return made


@pytest.fixture(scope="module")
def log():
    return make_log(model(**CURRENT), runs=4, duration=30.0, noise=0.5)


def test_a_current_that_has_changed_is_fitted_anew(log):
    given = model(0.2, -0.1)
    better = auvnn.improve(given, log, effects=["ocean_current", "net_buoyancy", "current_shear"])
    assert "ocean_current" in [s.step for s in better.steps]
    assert better.model.effect_names == ["ocean_current"]
    values = better.model.effect("ocean_current").values()
    assert values["v_north"] == pytest.approx(CURRENT["v_north"], abs=0.002)
    assert values["v_east"] == pytest.approx(CURRENT["v_east"], abs=0.002)
    assert better.waterfall[-1]["error"] < 0.2 * better.waterfall[0]["error"]


def test_what_the_model_has_is_asked_for_until_it_is_in_the_recipe(log):
    given = model(0.2, -0.1)
    judge = Judge.of(log, given.actuation)
    assert "ocean_current" in wanted(given, judge, Recipe())
    assert "ocean_current" not in wanted(given, judge, Recipe(effects=("ocean_current",)))


@pytest.mark.parametrize("effects", [None, ["ocean_current", "net_buoyancy"]])
def test_the_diagnosis_is_not_asked_for_what_the_loop_has_put_in(log, monkeypatch, effects):
    """It was fitted to this log; what the model had from elsewhere may be wrong."""
    asked = []

    def named(model, log, names, **_):
        asked.append(list(names))
        missing = ["net_buoyancy"] if len(asked) == 1 else []
        return SimpleNamespace(
            verdict="named" if missing else "unknown", missing=missing, nearest=[], story=[], steps=[]
        )

    monkeypatch.setattr(causes, "diagnose", named)
    monkeypatch.setattr(causes.Causes, "_add_best", take)
    walk = causes.Causes(model(0.2, -0.1), log, None, effects, 4, 600.0, None, None)
    walk.diagnose()
    assert "ocean_current" in asked[0] and "net_buoyancy" in asked[0]
    assert asked[1] == [n for n in asked[0] if n != "net_buoyancy"]


def take(self, group, *_, **__):
    self.state = replace(
        self.state, recipe=replace(self.state.recipe, effects=(*self.state.recipe.effects, *group))
    )
    return True
