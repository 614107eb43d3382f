"""Effects that do nothing by themselves: who asks for one alone is told what to ask for with it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

import auvnn
from auvnn.app.trial import catalogue
from auvnn.diagnosis.answers import answering
from auvnn.effects import EFFECTS
from auvnn.effects.acting_beside import in_words, needed_beside
from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.studies.benchmark import cases
from tests.small_logs import make_log, small_vehicle
from tests.studies.benchmark.plans import OPTIONS

WATER = ("ocean_current", "current_shear", "waves")


def test_what_is_missing_is_said_where_none_of_them_is_there():
    assert needed_beside("drag_only_current", ()) == needed_beside("drag_only_current", ["payload"]) == WATER
    assert needed_beside("drag_only_current", ["payload", "waves"]) == ()
    assert needed_beside("ocean_current", ()) == ()
    assert (
        in_words(WATER) == "ocean_current, current_shear or waves" and in_words(["body_lift"]) == "body_lift"
    )
    # Each of them stands alone itself.
    for name in EFFECTS.names():
        assert not any(EFFECTS.get(n).acts_with for n in EFFECTS.get(name).acts_with)


def test_it_is_not_added_alone():
    model = GreyBox(small_vehicle())
    log = make_log(model, noise=1.0)
    with pytest.raises(
        ConfigError, match="nothing by itself: add ocean_current, current_shear or waves with it"
    ):
        auvnn.add(model, log, "drag_only_current")


def test_the_page_offers_it_with_what_it_needs():
    model = GreyBox(small_vehicle())
    log = make_log(model, noise=1.0)

    def lacking(given):
        return next(c["lacks"] for c in catalogue(given, log) if c["name"] == "drag_only_current")

    assert "ocean_current, current_shear or waves" in lacking(model)
    assert lacking(model.with_effects({"ocean_current": {"v_north": 0.1}})) == []


def test_a_log_is_not_said_to_say_nothing_of_what_nothing_could_show():
    truth = GreyBox(small_vehicle()).with_effects({"net_buoyancy": {"force": 5.0}})
    log, model = make_log(truth, noise=1.0), GreyBox(small_vehicle())
    names = ["net_buoyancy", "drag_only_current"]
    said = " ".join(auvnn.diagnose(model, log, names, advice=False, costs=False, whiteness=False).warnings)
    assert "says nothing" not in said and "gross errors" not in said
    assert (
        "drag_only_current does nothing by itself: name ocean_current, current_shear or waves with it" in said
    )


def test_gross_errors_hide_all_that_could_act(monkeypatch):
    monkeypatch.setattr(answering, "noise_share", lambda _: 0.0)
    monkeypatch.setattr(answering, "reservations", lambda *_: [])
    monkeypatch.setattr(answering, "_length", lambda _: 5.0)
    model = GreyBox(small_vehicle())
    asked: Any = SimpleNamespace(
        model=model, log=make_log(model, noise=1.0), usable=["ocean_current", "payload", "drag_only_current"]
    )

    def said(*silent):
        state: Any = SimpleNamespace(
            silent=silent,
            first=SimpleNamespace(fitted=None),
            current=SimpleNamespace(effects=(), beside=()),
            failed={},
        )
        return " ".join(answering._warnings(asked, state))

    asked.layout = None
    assert "look for gross errors" in said("ocean_current", "payload")
    assert "the log says nothing about payload" in said("payload") and "gross" not in said("payload")


def test_it_is_not_hidden_alone_in_a_benchmark():
    with pytest.raises(ConfigError, match="it does nothing without body_lift, and cannot be hidden alone"):
        cases({**OPTIONS, "effects": ["body_lift_stall"], "sizes": "small"})
