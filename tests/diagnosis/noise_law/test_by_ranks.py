"""Names with which most windows are predicted better and the mean is not: what the median window costs counts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.noise_law.rounds import names_given
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.free_running_cost import Cost, free_running_cost
from auvnn.diagnosis.noise_law.rounds.names_given import NamesGiven
from auvnn.metrics.rollouts import scale_of
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.mark.parametrize(
    ("sure_in_the_mean", "typical", "moves", "closed_loop", "expected"),
    [
        # A few windows make the error three times as large without it, and the median one a hundredth.
        (False, 0.01, 0.01, False, []),
        (False, 0.01, 0.01, True, []),
        (False, 0.3, 0.01, False, ["coupled_damping"]),
        # Under a controller what the predictions of the median window move by counts, too.
        (False, 0.01, 0.3, False, []),
        (False, 0.01, 0.3, True, ["coupled_damping"]),
        # Where the mean is sure the error of all windows counts.
        (True, 0.01, 0.01, False, ["coupled_damping"]),
    ],
)
def test_where_most_windows_say_so_the_median_one_must_pay(
    monkeypatch, sure_in_the_mean, typical, moves, closed_loop, expected
):
    asked_for: list[float] = []

    def better(after, before, least, *, ranks):
        asked_for.append(least)
        return ranks or sure_in_the_mean

    monkeypatch.setattr(names_given, "predicts_better", better)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    monkeypatch.setattr(names_given, "cost_of_name", lambda *_, **__: Cost(2.0, typical, 2.0, moves, False))
    asked = NamesGiven(
        None, None, None, Tolerance.of(None), in_closed_loop=closed_loop, white_noise=False  # type: ignore[arg-type]
    )  # fmt: skip
    current: Any = SimpleNamespace(evidence=0.0, estimate=SimpleNamespace(law=None))
    found: Any = SimpleNamespace(name="coupled_damping", evidence=50.0)
    at = Round(None, current, [], ["tilted_vertical"])  # type: ignore[arg-type]
    assert [h.name for h in asked.good(at, 10, [found], 20.0)] == expected
    assert {*asked_for} == {names_given.GAIN_FURTHER}


@pytest.mark.parametrize(("error", "expected"), [(0.07, False), (0.11, True)])
def test_a_further_name_among_those_that_stand_must_cost_all_that_is_tolerated(monkeypatch, error, expected):
    """A first name would have to cost half of the tenth that is tolerated."""
    monkeypatch.setattr(names_given, "cost_of_name", lambda *_, **__: Cost(error, 0.0, 0.0, 0.0, False))
    asked = NamesGiven(None, None, None, Tolerance.of(None))  # type: ignore[arg-type]
    after, before = (SimpleNamespace(name="fin_lag", evidence=e) for e in (71.0, 0.0))
    assert asked.pays(after, before) is expected  # type: ignore[arg-type]


def test_what_moves_few_windows_moves_the_median_one_not_at_all():
    """A load that is picked up shortly before the end of each run."""
    model = GreyBox(small_vehicle())
    log = make_log(model, runs=2, duration=30.0, noise=0.01)
    late = model.with_effects({"payload": {"mass": 3.0, "time": 26.0}})
    early = model.with_effects({"payload": {"mass": 3.0, "time": 0.0}})
    few, all_of_them = (free_running_cost(m, model, log, scale_of(log)) for m in (late, early))
    assert few.moves > 0.3 and few.moves_typically == pytest.approx(0.0, abs=1e-6)
    assert all_of_them.moves_typically == pytest.approx(all_of_them.moves, rel=0.05)
