"""Which measured inputs are told of what is left: on made gains, window by window, whose answer is known."""

from __future__ import annotations

import numpy as np
import pytest

from auvnn.diagnosis.residuals.attribution import select_inputs

WINDOWS, WHOLE = 40, 100.0
SURGE, SWAY = 0, 1


def gain_of(random, at, spread):
    """Return one gain by window, (40,), of a given sum and standard error."""
    gain = random.normal(size=WINDOWS)
    gain = (gain - gain.mean()) / gain.std(ddof=1) * spread / np.sqrt(WINDOWS)
    return gain + at / WINDOWS


def select(gains, together=()):
    """Select from inputs with given gains, of which the first of a group leaves nothing for the others."""

    def left(chosen):
        now = np.full(WINDOWS, 10.0)
        for group in [*together, *([e] for e in gains if not any(e in g for g in together))]:
            of_group = [gains[e] for e in chosen if e in group]
            if of_group:
                now = now - of_group[0]
        return now

    return select_inputs(left, list(gains), WHOLE)


@pytest.fixture
def random():
    return np.random.default_rng(4)


def test_a_large_gain_of_few_windows_does_not_hide_a_sure_one(random):
    """A gain of 40 with a standard error of 30 may be chance; one of 10 with an error of 1 is none."""
    gains = {(SURGE, "speed"): gain_of(random, 40.0, 30.0), (SURGE, "rudder"): gain_of(random, 10.0, 1.0)}
    found = select(gains)
    assert list(found.shares["X"]) == ["rudder"]
    assert found.shares["X"]["rudder"] == pytest.approx(0.1)
    assert not found.inseparable


def test_inputs_that_say_the_same_are_told_together(random):
    same = gain_of(random, 30.0, 3.0)
    gains = {(SWAY, "rudder"): same, (SWAY, "speed"): same - gain_of(random, 0.5, 1.0)}
    found = select(gains, [list(gains)])
    assert found.inseparable == {"Y": [["rudder", "speed"]]}
    assert found.shares["Y"]["rudder"] == pytest.approx(0.3)
    assert found.shares["Y"]["speed"] == pytest.approx(0.295)
    assert not found.shares["X"]


def test_an_input_that_surely_says_less_is_not_told_beside(random):
    more = gain_of(random, 30.0, 3.0)
    gains = {(SWAY, "rudder"): more, (SWAY, "speed"): more - gain_of(random, 10.0, 1.0)}
    found = select(gains, [list(gains)])
    assert found.shares["Y"] == {"rudder": pytest.approx(0.3)}
    assert not found.inseparable


def test_an_input_that_explains_more_beside_is_told_for_itself(random):
    """Two of equal gain that add up are no tie: each is told with what it explains beside the other."""
    gains = {(SWAY, "rudder"): gain_of(random, 20.0, 1.0), (SWAY, "roll"): gain_of(random, 20.0, 1.0)}
    found = select(gains)
    assert found.shares["Y"] == {"rudder": pytest.approx(0.2), "roll": pytest.approx(0.2)}
    assert not found.inseparable


def test_one_degree_of_freedom_is_no_rival_of_another(random):
    same = gain_of(random, 30.0, 3.0)
    gains = {(SURGE, "speed"): same, (SWAY, "rudder"): same - gain_of(random, 0.5, 1.0)}
    found = select(gains)
    assert not found.inseparable
    assert list(found.shares["X"]) == ["speed"] and list(found.shares["Y"]) == ["rudder"]


def test_what_explains_next_to_nothing_is_not_told(random):
    found = select({(SURGE, "speed"): gain_of(random, 1.9, 0.1)})
    assert not any(found.shares.values())
