"""Commands between samples as the model states it: the search begins with that, and a log may contradict it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.diagnose import searched
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.commands.in_place_of_names import stand_for_another_law
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.noise_law.commands.stated import stated_commands, still_stated
from auvnn.diagnosis.noise_law.words import stochastic_words
from auvnn.diagnosis.stages.state import State
from auvnn.logs import Log
from auvnn.metrics.commands.stated import as_stated, interval_of
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands
from tests.small_logs import make_log, small_vehicle, thinned

STEP = 5
# Commands that change at 25 Hz and are held in between come half of 40 ms later than a curve through their samples.
LINE, CURVE = CommandPath("linear", 0.5, 0.2), CommandPath("smooth", 0.4, 0.2)
TIMED = ["actuation_delay", "thruster_lag"]


@pytest.fixture(scope="module")
def plain():
    return GreyBox(small_vehicle())


def made(model: GreyBox, *, held: bool, **hidden: dict[str, float]) -> Log:
    """Return a log at 5 Hz with what is hidden, its commands held or changed at 25 Hz."""
    plant = model.with_effects(hidden) if hidden else model
    rate = 5.0 if held else 5.0 * STEP
    log = make_log(plant, runs=3, duration=30.0, rate=rate, noise=0.3, max_step=0.04)
    return log if held else thinned(log, STEP)


def asked_of(model: GreyBox, log: Log, names: list[str]) -> tuple[Any, list[str]]:
    """Return a diagnosis, and what it said that it was doing."""
    said: list[str] = []
    return diagnose(model, log, names, advice=False, whiteness=False, costs=False, progress=said.append), said


@pytest.mark.parametrize(
    "path", [LINE, CommandPath("smooth", 0.4, 0.2, 0, "thrust"), CommandPath("averaged", 0.5, 0.2, 8)]
)
def test_commands_go_as_the_model_has_them_in_free_running(plain, path):
    model = with_commands(plain, path)
    windows = windows_for(model, make_log(plain, duration=12.0, rate=5.0))
    found = stated_commands(model, windows)
    assert found is not None and found.law.stated and found.law.path(0.2) == path
    assert torch.equal(found.law.applied(windows).inputs.command, as_stated(model, windows).inputs.command)
    finer = replace(found.law.applied(windows), max_step=0.01)
    assert found.as_read(finer).max_step == 0.01
    assert torch.equal(found.as_read(finer).inputs.command, windows.inputs.command)


def test_a_model_that_states_nothing_for_such_a_log_has_no_law(plain):
    windows = windows_for(plain, make_log(plain, duration=12.0, rate=5.0))
    assert stated_commands(plain, windows) is None
    assert stated_commands(with_commands(plain, CommandPath("linear", 0.5, 0.05)), windows) is None
    measured = replace(windows, nu_dot=torch.zeros_like(windows.nu))
    assert stated_commands(with_commands(plain, LINE), measured) is None


@pytest.mark.parametrize("path", [LINE, CommandPath("ahead", 1.0, 0.2)])
@pytest.mark.parametrize("held", [False, True])
def test_a_statement_stays_until_a_log_is_clearly_likelier_otherwise(plain, held, path):
    """It is asked about a fit to commands as stated, which may be far from what they are."""
    log = made(plain, held=held)
    model = with_commands(plain, path)
    windows, layout = windows_for(model, log), lay_out(model, [])
    stated = stated_commands(model, windows)
    assert stated is not None
    begin = stated.law.applied(windows)
    first = fit_hypothesis(layout, begin, list(layout.nuisance), ())
    law = still_stated(layout, stated, first, begin)
    # Neither is right: a line comes 20 ms too early where commands change between samples.
    assert law is None
    curve = stated_commands(with_commands(plain, CURVE), windows)
    assert curve is not None
    about = fit_hypothesis(layout, curve.law.applied(windows), list(layout.nuisance), ())
    law = still_stated(layout, curve, about, curve.law.applied(windows))
    assert (law is None) is held
    assert law is None or (law.stated and law.odds > 10.0 and law.to_dict()["stated"] is True)


def test_what_cannot_be_compared_stays_as_it_is_stated(plain, monkeypatch):
    log = made(plain, held=True)
    model = with_commands(plain, LINE)
    windows, layout = windows_for(model, log), lay_out(model, [])
    stated = stated_commands(model, windows)
    assert stated is not None
    first = fit_hypothesis(layout, stated.law.applied(windows), list(layout.nuisance), (), iterations=1)

    def diverging(*_: Any) -> Any:
        raise np.linalg.LinAlgError("without bound")

    monkeypatch.setattr("auvnn.diagnosis.noise_law.commands.stated.fitted_to", diverging)
    assert still_stated(layout, stated, first, stated.law.applied(windows)) is stated.law


@pytest.mark.parametrize(
    ("held", "hidden", "stand"),
    [(True, {}, True), (False, {"actuation_delay": {"delay": 0.3}}, False), (False, {}, False)],
)
def test_a_delay_may_stand_for_another_law_than_the_stated_one(plain, held, hidden, stand):
    """Held commands come later than a line; a delay that is there is more than that."""
    log = made(plain, held=held, **hidden)
    model = with_commands(plain, LINE if held else CURVE)
    windows, layout = windows_for(model, log), lay_out(model, TIMED)
    stated = stated_commands(model, windows)
    assert stated is not None
    begin, base = stated.law.applied(windows), list(layout.nuisance)
    first = fit_hypothesis(layout, begin, base, ())
    end = fit_hypothesis(layout, begin, base, TIMED[:1]) if held or hidden else first
    asked: Any = SimpleNamespace(layout=layout, base=tuple(base), commands=stated)
    state = State(begin, first, end, chosen=end.effects, path=(end,))
    assert stand_for_another_law(asked, state) is stand
    # Of a search that begins with commands as read it is asked elsewhere.
    assert not stand_for_another_law(SimpleNamespace(**{**vars(asked), "commands": None}), state)


def test_an_answer_says_that_the_model_states_it():
    (line,) = stochastic_words(
        {"commands": replace(Holding("linear", 0.5, 9.0, 18.0), stated=True).to_dict()}
    )
    assert line.endswith("The model states it.")


@pytest.mark.long
def test_a_search_begins_with_commands_as_the_model_states_them(plain):
    """Nobody asks how commands go where the statement and a delay explain the log; without one it is searched again."""
    log = made(plain, held=False, actuation_delay={"delay": 0.3})
    for model in (with_commands(plain, CURVE), plain):
        found, said = asked_of(model, log, TIMED)
        again = [words for words in said if "searching again" in words]
        told = found.stochastic["commands"]
        assert found.missing == ["actuation_delay"] and told["between_samples"] == "smooth"
        assert told.get("stated", False) is not bool(again) and bool(again) is (model is plain)


@pytest.mark.long
def test_a_statement_that_the_log_contradicts_gives_no_name(plain):
    """Held commands taken along a line come half an interval too early: the statement is wrong, and no delay is there."""
    found, said = asked_of(with_commands(plain, LINE), made(plain, held=True), TIMED)
    assert found.missing == [] and found.verdict == "adequate"
    assert [words for words in said if "searching again" in words]
    assert found.stochastic["commands"]["between_samples"] == "held"
    assert [words for words in found.warnings if "as the model states it" in words]


def test_what_is_told_of_an_answer_is_worked_out_with_commands_that_go_as_the_log_says(plain):
    """With held commands free running would show errors that no name takes away, and the name would seem to cost less."""
    log = made(plain, held=False, net_buoyancy={"force": 6.0})
    found, under_way = searched(plain, log, ["net_buoyancy"], advice=False, whiteness=False)
    told, best = found.stochastic["commands"], under_way.state.current.fitted.model
    assert found.missing == ["net_buoyancy"] and told["between_samples"] != "held"
    for model in (under_way.setting.model, under_way.layout.model, best):
        path = model.commands
        assert path is not None and path.between_samples == told["between_samples"]
        assert path.share_of_next == pytest.approx(told["share_of_next"])
        assert path.counts_at(interval_of(windows_for(plain, log)))
    assert plain.commands is None, "the model that was given stays as it is"

    def cost(path: CommandPath | None) -> float:
        models = (with_commands(m, path) for m in (plain, best.without_absent(["net_buoyancy"])))
        without, whole = (roll(m, log, "5", scale_of(log)) for m in models)
        assert without is not None and whole is not None
        return without.total(scale_of(log)) / whole.total(scale_of(log)) - 1.0

    assert found.matters["net_buoyancy"]["cost"] == pytest.approx(cost(best.commands), rel=0.2)
    assert cost(best.commands) > 2.0 * cost(None)
