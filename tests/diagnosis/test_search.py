"""When a search for names alone ends because a force stays."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import search
from auvnn.diagnosis.search import a_force_stays


def fit(share: float) -> SimpleNamespace:
    """Return a fit in which the noise, of 0.1 in one channel, has such a share of the squared error that is left."""
    noise, count = np.full(18, np.nan), np.zeros((1, 18))
    noise[0], count[0, 0] = 0.1, 100.0
    sums = SimpleNamespace(count=count, channel=count * 0.1**2 / share, noise=lambda: noise)
    return SimpleNamespace(sigma=np.where(count[0] > 0, 1.0, np.inf), statistics=sums)


def state(rounds: int, shares: Any = None) -> Any:
    """Return a search after so many rounds, and of the noise's share in the error at first and after each."""
    first, *path = [SimpleNamespace(fitted=fit(s)) for s in shares or (1.0,) * (rounds + 1)]
    return SimpleNamespace(path=tuple(path), first=first, current=[first, *path][-1], windows=None)


def stays(monkeypatch, rounds, share, p_value=1e-9, shares=None):
    left = SimpleNamespace(p_value=p_value, left_of=lambda before: share)
    monkeypatch.setattr(search, "white", lambda *_: None)
    monkeypatch.setattr(search, "variance_component_test", lambda *_: left)
    asked: Any = SimpleNamespace(floor=0.0)
    return a_force_stays(asked, state(rounds, shares))


@pytest.mark.parametrize(
    ("rounds", "share", "expected"),
    [(0, 1.0, False), (1, 0.95, True), (1, 0.7, False), (2, 0.7, True), (2, 0.4, False)],
)
def test_after_one_round_nearly_all_must_stay_and_later_most(monkeypatch, rounds, share, expected):
    assert stays(monkeypatch, rounds, share) is expected


@pytest.mark.parametrize(
    ("shares", "expected"),
    [
        # Error of 20 times the noise before: 19 of it above the noise, of which a quarter is 4.75.
        ((1 / 20, 1 / 20), True),
        ((1 / 20, 1 / 15.5), True),
        ((1 / 20, 1 / 15), False),
        # What counts is what the last name has taken.
        ((1 / 20, 1 / 10, 1 / 9), True),
        ((1 / 20, 1 / 19.9, 1 / 9), False),
        # As much noise as anything else: names are sought on.
        ((0.6, 0.6), False),
    ],
)
def test_where_most_of_the_error_is_left_a_name_must_take_a_quarter_of_it(monkeypatch, shares, expected):
    assert stays(monkeypatch, len(shares) - 1, 0.4, shares=shares) is expected
    assert not stays(monkeypatch, len(shares) - 1, 0.4, p_value=0.01, shares=shares)


def test_what_chance_may_leave_is_no_force(monkeypatch):
    assert not stays(monkeypatch, 2, 0.9, p_value=0.01)


def test_where_the_test_cannot_be_solved_the_search_goes_on(monkeypatch):
    def unsolved(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(search, "white", lambda *_: None)
    monkeypatch.setattr(search, "variance_component_test", unsolved)
    asked: Any = SimpleNamespace(floor=0.0)
    assert not a_force_stays(asked, state(3))
