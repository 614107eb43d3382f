"""Which of the likely names cost enough in free running."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.noise_law.rounds import names_given
from auvnn.diagnosis.noise_law.rounds.free_running_cost import Cost
from tests.diagnosis.noise_law.stand_ins import given, hypothesis


@pytest.mark.parametrize(
    ("error", "typical", "expected"),
    [
        (-0.6, -0.13, True),
        (-0.06, -0.06, True),
        (-0.6, -0.04, False),
        (-0.04, -0.6, False),
        (0.2, 0.3, False),
    ],
)
def test_names_worsen_free_running_where_they_do_in_all_windows_and_in_the_median_one(
    monkeypatch, error, typical, expected
):
    ran: list[Any] = []

    def cost(after, before, log, scale):
        ran.append((after, before))
        return Cost(error, typical, 0.0, 0.0, False)

    monkeypatch.setattr(names_given, "free_running_cost", cost)

    def of(*effects: str) -> Any:
        model = SimpleNamespace(without_absent=lambda names: ("lean", *names))
        return SimpleNamespace(
            explanation=SimpleNamespace(effects=effects, fitted=SimpleNamespace(model=model))
        )

    assert given(tolerance=Tolerance.of(None)).worsen(of("waves", "tether"), of()) is expected
    assert ran == [(("lean", "waves", "tether"), ("lean",))]
    # Where everything matters that is there, evidence alone counts.
    assert not given(tolerance=Tolerance.of(0)).worsen(of("waves"), of()) and len(ran) == 1


def paying(costs, monkeypatch, without=1e3, **changes):
    """Return which of some explanations, each ten in evidence after the one before it, are taken at these costs.

    The first is ahead of the explanation without any by 450.
    """
    likely = [hypothesis(name, 100.0 + 20.0 * k) for k, name in enumerate(costs)]

    def cost_of(_, h, *__, **___):
        """Return what is given: error and moves, then whether it is surely worse (yes), and in the median window."""
        error, moves, *more = costs[h.name]
        return Cost(error, *(more[1:] or [error]), moves, 0.0, bool(more[0]) if more else True)  # type: ignore[arg-type]

    monkeypatch.setattr(names_given, "cost_of_name", cost_of)
    return [h.name for h in given(**changes).paying(likely, hypothesis("", without), 0.5)]


def test_a_name_must_cost_enough_by_the_errors(monkeypatch):
    assert paying({"tether": (0.2, 0.0), "waves": (0.01, 0.3)}, monkeypatch) == ["tether"]
    # One that costs little and is likelier comes before one that costs enough; by itself it is not given.
    assert paying({"waves": (0.01, 0.01), "tether": (0.2, 0.0)}, monkeypatch) == ["waves", "tether"]
    assert paying({"waves": (0.01, 0.3)}, monkeypatch) == []
    assert paying({"waves": (0.01, 0.3)}, monkeypatch, ignores_cost=True) == ["waves"]
    assert paying({"waves": (-0.2, 0.3)}, monkeypatch, ignores_cost=True) == []
    assert paying({"waves": (-0.2, 0.3)}, monkeypatch, tolerance=Tolerance.of(0)) == ["waves"]


def test_what_is_beyond_doubt_is_named_whatever_it_costs(monkeypatch):
    """The first has a misfit of 100 and the second one of 120: twice the log odds are what they are below `without`."""
    one, both = {"waves": (-0.2, 0.0)}, {"waves": (-0.2, 0.0), "tether": (0.01, 0.0)}
    enough = 100.0 + 2.0 * names_given.DECISIVE
    assert paying(one, monkeypatch, without=enough + 1.0) == ["waves"]
    assert paying(one, monkeypatch, without=enough - 1.0) == []
    assert paying(both, monkeypatch, without=enough + 19.0) == ["waves"]
    assert paying(both, monkeypatch, without=enough + 21.0) == ["waves", "tether"]


def test_in_open_loop_free_running_must_not_get_worse(monkeypatch):
    # One that is less likely does not stand in the way of another one.
    assert paying({"tether": (0.2, 0.2), "waves": (-0.2, 0.3)}, monkeypatch) == ["tether"]
    assert paying({"waves": (-0.01, 0.3), "tether": (0.2, 0.2)}, monkeypatch) == []
    assert paying({"waves": (-0.2, 0.01), "tether": (0.2, 0.2)}, monkeypatch) == []
    # Where predictions hardly move, half of a tenth being enough, neither stands against the other.
    assert paying({"waves": (-0.01, 0.03), "tether": (0.2, 0.2)}, monkeypatch) == ["tether"]


def test_where_sensors_are_not_white_a_few_windows_do_not_decide_what_a_name_costs(monkeypatch):
    """They may put windows on a wrong start: the median window says that a name costs enough, and chance is no word."""
    costly, by_chance = (-0.2, 0.3, True, 0.06), (-0.2, 0.3, False)
    for white, costs, expected in (
        (False, {"waves": costly}, ["waves"]),
        # White: where the mean is surely worse it counts, and otherwise the median window may say so too.
        (True, {"waves": costly}, []),
        (True, {"waves": (-0.2, 0.3, False, 0.06)}, ["waves"]),
        (True, {"waves": (-0.2, 0.3, False, 0.04)}, []),
        (False, {"waves": (-0.2, 0.3, True, 0.04)}, []),
        (False, {"waves": by_chance, "tether": (0.2, 0.2)}, ["tether"]),
        (False, {"waves": (-0.2, 0.3, True), "tether": (0.2, 0.2)}, []),
        (True, {"waves": by_chance, "tether": (0.2, 0.2)}, []),
    ):
        assert paying(costs, monkeypatch, white_noise=white) == expected


def test_in_closed_loop_it_is_enough_that_predictions_move(monkeypatch):
    costs = {"waves": (-0.2, 0.2), "tether": (-0.2, 0.01), "payload": (0.2, 0.0)}
    assert paying(costs, monkeypatch, in_closed_loop=True) == ["waves", "payload"]
    assert paying({"waves": (0.0, 0.01)}, monkeypatch, in_closed_loop=True) == []


def test_what_is_known_to_be_confused_with_a_name_is_compared_with_it_whatever_it_costs(monkeypatch):
    cheap, dear = (-0.2, 0.01), (0.2, 0.2)
    assert paying({"tether": dear, "biofouling": cheap}, monkeypatch) == ["tether", "biofouling"]
    assert paying({"tether": dear, "waves": cheap}, monkeypatch) == ["tether"]
