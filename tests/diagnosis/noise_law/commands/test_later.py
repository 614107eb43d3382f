"""Lags that only say by how much of an interval commands act later, told from lags that are there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law import answer
from auvnn.diagnosis.noise_law.commands import later
from auvnn.diagnosis.noise_law.commands.later import late_by_a_share
from auvnn.diagnosis.noise_law.commands.law import HELD, Holding
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.diagnosis.stages.state import State
from auvnn.metrics.commands.mean_thrust import MeanThrust
from auvnn.metrics.commands.stated import interval_of
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath
from tests.small_logs import make_log, small_vehicle, thinned

STEP = 5
NAMES = ["net_buoyancy", "thruster_lag"]


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def ended(model: GreyBox, hidden: dict[str, Any], names: list[str]) -> tuple[Any, State, Any, Holding]:
    """Return what is asked, a search that has ended with names, windows as read, and a cubic that is not late."""
    log = thinned(
        make_log(model.with_effects(hidden), runs=3, duration=30.0, rate=25.0, noise=0.3, max_step=0.04), STEP
    )
    raw, layout = windows_for(model, log), lay_out(model, NAMES)
    law = Holding("smooth", 0.5, 100.0, 100.0, curves=MeanThrust.of(model))
    windows, base = law.applied(raw), list(layout.nuisance)
    first = fit_hypothesis(layout, windows, base, ())
    end = fit_hypothesis(layout, windows, base, names)
    asked = SimpleNamespace(
        layout=layout, base=tuple(base), chooser=lambda w: Chooser(layout, w, lambda _: None)
    )
    return asked, State(windows, first, end, chosen=tuple(names), path=(end,)), raw, law


@pytest.fixture(scope="module")
def late(model):
    """Return a search by a cubic, of commands of five ticks a sample: they act a tenth of an interval later."""
    return ended(model, {"net_buoyancy": {"force": 8.0}}, NAMES)


def test_a_lag_of_part_of_a_tick_is_another_share(late):
    asked, state, raw, law = late
    assert 0.005 < state.current.fitted.model.effect("thruster_lag").theta.item() < 0.06
    found = late_by_a_share(asked, state, raw, law)
    assert found is not None
    fewer, other = found
    assert fewer.effects == ("net_buoyancy",)
    assert other.share == pytest.approx(0.4, abs=0.05)


def test_a_lag_that_is_longer_than_an_interval_leaves_open_stays(model, monkeypatch):
    """Whatever another share does."""
    asked, state, raw, law = ended(model, {"thruster_lag": {"time_constant": 0.3}}, ["thruster_lag"])
    assert late_by_a_share(asked, state, raw, law) is None
    monkeypatch.setattr(later, "cost_with", lambda *_: 0.0)
    monkeypatch.setattr(later, "with_share", lambda *_: replace(law, share=0.1))
    assert late_by_a_share(asked, state, raw, law) is None
    monkeypatch.setattr(later, "WITHIN", 20.0)
    assert late_by_a_share(asked, state, raw, law) is not None


def test_a_long_lag_that_the_model_states_does_not_count(model):
    """Only names are asked whether they are shorter than an interval leaves open."""
    there = {"thruster_lag": {"time_constant": 0.4}, "actuation_delay": {"delay": 0.02}}
    fitted = SimpleNamespace(model=model.with_effects(there), theta=np.array([0.4, 0.02]))
    windows = windows_for(model, make_log(model, duration=12.0, rate=5.0))
    for named, within in ((("actuation_delay",), True), (("thruster_lag", "actuation_delay"), False)):
        end = SimpleNamespace(fitted=fitted, names=tuple(there), effects=named)
        assert later._within_an_interval(end, windows) == within


def test_nothing_is_asked_without_names_of_timing_or_where_commands_are_held(late):
    asked, state, raw, law = late
    plain = fit_hypothesis(asked.layout, state.windows, list(asked.base), ["net_buoyancy"])
    assert late_by_a_share(asked, state.but(current=plain), raw, law) is None
    assert late_by_a_share(asked, state, raw, HELD) is None
    assert late_by_a_share(asked, state, raw, replace(law, name="averaged", samples=8)) is None


def test_what_the_law_does_less_well_stays_a_name(late, monkeypatch):
    """Where the other share leaves more than a fifth of what the names did."""
    asked, state, raw, law = late
    monkeypatch.setattr(later, "with_share", lambda *_: replace(law, share=0.47))
    assert late_by_a_share(asked, state, raw, law) is None
    monkeypatch.setattr(later, "with_share", lambda *_: law)
    assert late_by_a_share(asked, state, raw, law) is None


def test_the_answer_searches_again_without_it(late, monkeypatch):
    asked, state, raw, law = late
    made = []

    def searched(asked: Any, windows: Any, until: Any = None) -> State:
        made.append((asked.usable, windows))
        return state.but(windows=windows, current=state.current if len(made) == 1 else state.first)

    paths: list[CommandPath] = []

    def given(asked: Any, usable: tuple[str, ...]) -> Any:
        """Return what is asked, of these effects, that keeps how models are to run."""
        made = SimpleNamespace(**{**vars(asked), "usable": usable})
        made.with_commands = lambda path: paths.append(path) or made
        return made

    asked = given(SimpleNamespace(**vars(asked), floor=1e-9, commands=None, say=lambda _: None), tuple(NAMES))
    monkeypatch.setattr(answer, "search", searched)
    monkeypatch.setattr(answer, "_held", lambda *_: (state.first, law))
    monkeypatch.setattr(answer, "with_share", lambda *_: law)
    monkeypatch.setattr(answer, "without_timed", lambda *_: None)
    monkeypatch.setattr(answer, "uncertain_wrench", lambda *_: SimpleNamespace(to_dict=dict))
    monkeypatch.setattr(answer, "noise_colour", lambda *_: answer.Colour(None, 0.0))
    monkeypatch.setattr(answer, "sensing_alone", lambda *_: None)
    monkeypatch.setattr(
        answer, "without", lambda asked, gone: given(asked, tuple(n for n in asked.usable if n not in gone))
    )
    began = state.but(windows=raw, steps=({"verdict": "unknown", "effects": [], "p_value": 0.0},))
    monkeypatch.setattr(answer, "_names_alone", lambda asked, began, state, told, words: (state, told, words))
    monkeypatch.setattr(State, "leaves_something", property(lambda self: self.windows is raw))
    found, told, _ = answer.answer_with_force(asked, began)
    assert [usable for usable, _ in made] == [tuple(NAMES), ("net_buoyancy",)]
    # What names cost in free running is worked out with commands that go so: as they were first found, then later.
    shares = [law.share, told["commands"]["share_of_next"]]
    assert [p.share_of_next for p in paths] == pytest.approx(shares) and shares[0] != shares[1]
    assert [p.interval for p in paths] == pytest.approx([interval_of(raw)] * 2)
    assert "thruster_lag" in found.failed and told["commands"]["share_of_next"] == pytest.approx(
        0.4, abs=0.05
    )
