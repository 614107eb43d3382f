"""When a search goes over to shorter windows: where most of the error is left, and what they name leaves the noise."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from auvnn.diagnosis.hypotheses.measured_start import noise_share
from auvnn.diagnosis.noise_law.commands.law import Holding
from auvnn.diagnosis.noise_law.commands.stated import StatedCommands
from auvnn.diagnosis.stages import shorter_windows
from auvnn.diagnosis.stages.shorter_windows import BEYOND, Progress, search_over_shorter
from auvnn.errors import InputError
from auvnn.models import load
from auvnn.simulation import simulate

STEP = 0.1


def explanation(ratio):
    """Return a fit that leaves `ratio` times the variance of the noise, in three channels that were measured."""
    count = np.zeros((1, 18))
    count[:, :3] = 100.0
    noise = np.full(18, np.nan)
    noise[:3] = [0.1, 2.0, 0.03]
    channel = np.zeros((1, 18))
    channel[:, :3] = 100.0 * ratio * noise[:3] ** 2
    sums = SimpleNamespace(count=count, channel=channel, noise=lambda: noise)
    return SimpleNamespace(fitted=SimpleNamespace(sigma=np.where(count[0] > 0, 1.0, np.inf), statistics=sums))


@dataclass(frozen=True)
class Asked:
    """What is asked, as far as it is looked at."""

    log: object
    layout: object
    floor: object = 0.0
    notes: tuple = ("stated",)
    driven: object = None
    commands: object = None

    def say(self, words):
        """Say nothing."""


def state(ratio, chosen=(), length=5.0, leaves=True):
    mask = np.zeros((4, round(length / STEP), 18))
    return SimpleNamespace(
        windows=SimpleNamespace(mask=mask), current=explanation(ratio), first=explanation(8.0), chosen=chosen,
        leaves_something=leaves,
    )  # fmt: skip


@pytest.fixture(scope="module")
def asked():
    model = load("rov95")
    made = simulate(model, "multisine", "realistic", runs=1, duration=20.0, rate=1.0 / STEP, max_step=0.05)
    return Asked(made.log, SimpleNamespace(model=model, nuisance=("inertia",)))


def test_the_share_of_the_noise_is_the_ratio_of_the_squares():
    assert noise_share(explanation(1.0).fitted) == pytest.approx(1.0)
    assert noise_share(explanation(4.0).fitted) == pytest.approx(0.25)
    # Less than the noise is as good as the noise.
    assert noise_share(explanation(0.8).fitted) == 1.0


def test_names_that_leave_the_noise_alone_are_taken_and_said(asked):
    seen = []

    def search(what, windows, worthwhile, promising):
        seen.append(windows.mask.shape[1] * STEP)
        assert worthwhile(state(1.5)) and not worthwhile(state(5.0))
        at, tested = before_a_round(5.0, [0.1, 0.41])
        # What is stated of this model is its inertia.
        assert promising(at, {"body_lift": tested["effect 1"]}) and not promising(
            at, {"inertia": tested["effect 1"]}
        )
        return state(1.1, ("body_lift",))

    given, found = search_over_shorter(asked, state(5.0), search)
    assert found.chosen == ("body_lift",)
    assert seen == [pytest.approx(2.0, abs=0.11)]
    assert given.notes[0] == "stated" and "windows of 2 s were taken" in given.notes[1]
    assert np.shape(given.floor) == (18,)


def test_shorter_windows_go_between_samples_as_the_model_states(asked):
    law = Holding("averaged", 0.5, 0.0, 0.0, 4, stated=True)
    seen = []

    def search(what, windows, *_, **__):
        seen.append((what, windows))
        return state(1.1, ("body_lift",))

    given, _ = search_over_shorter(replace(asked, commands=StatedCommands(None, law)), state(5.0), search)
    what, windows = seen[0]
    assert given.commands is what.commands and what.commands.law is law
    read = what.commands.read.inputs.command
    assert torch.equal(windows.inputs.command, law.applied(what.commands.read).inputs.command)
    assert not torch.equal(windows.inputs.command, read)


def test_a_name_that_takes_little_away_ends_the_search():
    # Shares of the noise: an eighth before any name, then 0.6 of the squared error, 0.65, and 0.9.
    go_on = Progress()
    assert go_on(state(1.0 / 0.6)) and not go_on(state(1.0 / 0.65))
    go_on = Progress()
    assert go_on(state(1.0 / 0.6)) and go_on(state(1.0 / 0.72)) and go_on(state(1.0 / 0.9))
    # Where no more than the noise is left, the search comes to its end.
    assert go_on(state(1.0 / 0.9))


def before_a_round(ratio, gains):
    """Return where a search stands before a round, and its tests: gains are shares of the squared error."""
    at = state(ratio)
    at.current.fitted.statistics.cost = np.array([30.0, 70.0])
    tested = {f"effect {k}": SimpleNamespace(gain=100.0 * g, degrees=1) for k, g in enumerate(gains)}
    # What is stated, or does not show, promises nothing.
    return at, {
        "stated": SimpleNamespace(gain=1e3, degrees=1), "unseen": SimpleNamespace(gain=1e3, degrees=0), **tested,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("ratio", "gains", "expected"),
    [
        # The noise is a fifth: it must become a half of what is left, so that 0.6 of the squared error has to go.
        (5.0, [0.1, 0.41], True),
        (5.0, [0.1, 0.39], False),
        # It is 0.6 of it: 0.7 is a quarter of the rest, so that a seventh has to go.
        (1.0 / 0.6, [0.0953], True),
        (1.0 / 0.6, [0.0951], False),
        (5.0, [], False),
        # Where no more than the noise is left, the search comes to its end.
        (1.0 / 0.81, [], True),
    ],
)
def test_fits_are_made_only_where_a_test_promises_what_a_name_must_take(ratio, gains, expected):
    assert Progress(["stated"]).promising(*before_a_round(ratio, gains)) is expected


def test_what_is_promised_is_what_progress_asks_for():
    """A name that takes exactly what its test must promise, all of it beyond the noise, is progress."""
    for noise in (0.1, 0.3, 0.6, 0.75):
        go_on, shares = Progress(["stated"]), np.linspace(0.0, 1.0 - noise, 2001)
        enough = next(g for g in shares if go_on.promising(*before_a_round(1.0 / noise, [g / BEYOND])))
        at = state((1.0 - enough) / noise, ("body_lift",))
        at.first = explanation(1.0 / noise)
        assert go_on(at) and not Progress()(SimpleNamespace(
            first=at.first, current=explanation((1.0 - enough) / noise + 0.02)
        ))  # fmt: skip


@pytest.mark.parametrize(
    "found",
    [state(1.1), state(2.0, ("body_lift",))],
    ids=["nothing is named", "the names leave more than the noise"],
)
def test_else_the_answer_stays(asked, found):
    before = state(5.0)
    assert search_over_shorter(asked, before, lambda *_, **__: found) == (asked, before)


@pytest.mark.parametrize(
    "before",
    [state(1.5), state(5.0, leaves=False), state(5.0, length=2.0)],
    ids=["the noise is most of it", "nothing is left", "the windows are short"],
)
def test_nothing_is_searched_where_the_usual_windows_do(asked, before):
    def search(*_, **__):
        raise AssertionError("searched")

    assert search_over_shorter(asked, before, search) == (asked, before)


def test_too_few_samples_or_a_model_that_runs_away_keep_the_answer(asked, monkeypatch):
    def refuse(*_, **__):
        raise InputError("runs away")

    monkeypatch.setattr(shorter_windows, "windows_that_hold", refuse)
    before = state(5.0)
    assert search_over_shorter(asked, before, refuse) == (asked, before)
    slow = replace(asked, log=SimpleNamespace(runs=[SimpleNamespace(dt=0.5)]))
    assert search_over_shorter(slow, before, refuse) == (slow, before)


def test_a_search_is_given_up_after_the_first_round_that_is_not_worth_it(monkeypatch):
    module = importlib.import_module("auvnn.diagnosis.search")
    rounds = iter([2.0, 5.0, 1.0])
    monkeypatch.setattr(module, "fit_null", lambda *_: SimpleNamespace(ended=False))
    monkeypatch.setattr(
        module, "search_round", lambda *_: SimpleNamespace(ended=False, current=explanation(next(rounds)))
    )
    left = module.search(None, None, lambda found: noise_share(found.current.fitted) >= 0.5)
    assert noise_share(left.current.fitted) == pytest.approx(0.2) and next(rounds) == 1.0


def test_a_search_whose_tests_promise_nothing_is_given_up_before_its_fits(monkeypatch):
    module = importlib.import_module("auvnn.diagnosis.search")
    begun = SimpleNamespace(ended=False)
    monkeypatch.setattr(module, "fit_null", lambda *_: begun)
    monkeypatch.setattr(
        module, "search_round", lambda asked, state, promising: state if not promising(state, {}) else None
    )
    assert module.search(None, None, lambda _: True, promising=lambda *_: False) is begun
