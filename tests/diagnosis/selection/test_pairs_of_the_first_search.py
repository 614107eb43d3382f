"""Before any name the first search fits what moves the water together with what acts beside it only, as one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn import diagnose, load, simulate
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.selection import model_comparison, refit_leaders
from auvnn.diagnosis.selection.choose import Choice
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.diagnosis.stages import search_round as search_round_module
from auvnn.diagnosis.stages.state import State
from auvnn.effects.acting_beside import in_order, in_place_of
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.models import GreyBox
from tests.small_logs import small_vehicle

WATER = ["ocean_current", "current_shear", "waves"]
OPEN = [*WATER, "drag_only_current", "payload"]
LEFT_OUT = ["added_mass_coriolis"]


def test_they_are_told_in_the_order_in_which_one_needs_the_other():
    assert in_order(["drag_only_current", "ocean_current"]) == ["ocean_current", "drag_only_current"]
    assert in_order(["payload", "added_mass"]) == ["payload", "added_mass"]
    # Beside a current that was there before, it may come first.
    assert in_order(["drag_only_current", "payload"]) == ["drag_only_current", "payload"]


@pytest.fixture(scope="module")
def in_the_drag_alone():
    """A log of a vehicle in a current that its drag alone feels, as simulators have it."""
    hidden = {"ocean_current": {"v_north": 0.15, "v_east": -0.1}, "drag_only_current": {"share": 1.0}}
    return simulate("bluerov2_heavy", hidden=hidden, runs=3, duration=20, rate=20, noise="realistic", seed=5)


def test_the_first_search_finds_a_current_that_the_drag_alone_feels(in_the_drag_alone):
    asked = [
        *LEFT_OUT,
        "ocean_current",
        "drag_only_current",
        "drag_curve",
        "quadratic_damping",
        "turning_forces",
    ]
    found = diagnose(load("bluerov2_heavy"), in_the_drag_alone, effects=asked, stochastic=False, advice=False)
    # In one step: neither stands without the other.
    assert found.steps[0]["effects"] == found.missing == ["ocean_current", "drag_only_current"]
    values = {c["effect"]: c["parameters"] for c in found.candidates}
    for name, parameter, truth in (
        ("ocean_current", "v_north", 0.15),
        ("ocean_current", "v_east", -0.1),
        ("drag_only_current", "share", 1.0),
    ):
        told = values[name][parameter]
        assert abs(told["value"] - truth) < 3.0 * told["std"] and told["std"] < 0.1


@pytest.mark.parametrize("ahead", [ODDS + 1.0, ODDS - 1.0])
def test_a_pair_of_the_first_search_must_be_likelier_by_what_a_name_needs(monkeypatch, ahead):
    asked = []

    def fit(beside, candidate, other=None):
        asked.append(other)
        sums = SimpleNamespace(slope=None, total=None, run=None)
        return SimpleNamespace(
            fitted=SimpleNamespace(statistics=sums), evidence=0.0 if other is None else ahead
        )

    monkeypatch.setattr(refit_leaders, "refitted", fit)
    monkeypatch.setattr(refit_leaders, "variance_inflation", lambda *_: 1.0)
    monkeypatch.setattr(refit_leaders, "log_evidence", lambda layout, e, factor: e)
    beside: Any = SimpleNamespace(layout=None, chosen=[], open_to=OPEN, base=[])
    found = refit_leaders._fitted(beside, SimpleNamespace(effect="ocean_current"))  # type: ignore[arg-type]
    assert asked == [None, "drag_only_current"]
    assert found.evidence == (ahead if ahead > ODDS else 0.0)
    asked.clear()
    refit_leaders._fitted(beside, SimpleNamespace(effect="payload"))  # type: ignore[arg-type]
    assert asked == [None]


def test_a_pair_that_cannot_be_fitted_leaves_the_effect_alone(monkeypatch):
    def fit(beside, candidate, other=None):
        if other is not None:
            raise FitError("no")
        return "alone"

    monkeypatch.setattr(refit_leaders, "refitted", fit)
    beside: Any = SimpleNamespace(layout=None, chosen=[], open_to=OPEN, base=[])
    assert refit_leaders._fitted(beside, SimpleNamespace(effect="ocean_current")) == "alone"  # type: ignore[arg-type]


def test_what_acts_beside_a_name_only_goes_and_comes_with_it():
    pair = ["payload", "drag_only_current", "ocean_current"]
    assert in_place_of("ocean_current", pair, ["thruster_gain"]) == (
        ["ocean_current", "drag_only_current"],
        ["thruster_gain"],
    )
    assert in_place_of("payload", ["payload"], ["drag_only_current", "waves"]) == (
        ["payload"],
        ["drag_only_current", "waves"],
    )
    # Where water still moves, it stays.
    assert in_place_of("ocean_current", pair, ["current_shear"]) == (["ocean_current"], ["current_shear"])
    assert in_place_of("ocean_current", [*pair, "waves"], ["tether"]) == (["ocean_current"], ["tether"])


def test_two_explanations_are_joined_with_all_of_their_names(monkeypatch):
    """A pair is no single effect of three parameters: what acts beside it only is part of it."""
    layout, asked = lay_out(GreyBox(small_vehicle()), [*OPEN, "thruster_gain"]), {}

    def fit(layout, windows, base, effects, **more):
        model = more["guess"].model
        asked[tuple(effects)] = parameters_of(model, ["ocean_current", "drag_only_current"]).tolist()

    monkeypatch.setattr(model_comparison, "fit_hypothesis", fit)
    compare = model_comparison.ModelComparison(layout, None, lambda _: None)  # type: ignore[arg-type]
    model = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(model, ["ocean_current", "drag_only_current"], np.array([0.1, 0.2, 0.0, 0.9]))
    fitted = SimpleNamespace(model=model, sigma=None)
    pair: Any = SimpleNamespace(effects=("drag_only_current", "ocean_current"), fitted=fitted)
    other: Any = SimpleNamespace(effects=("thruster_gain",), fitted=fitted)
    compare.together(other, pair, layout, [])
    compare.together(pair, other, layout, [])
    assert asked == {
        ("thruster_gain", "drag_only_current", "ocean_current"): [0.1, 0.2, 0.0, 0.9],
        ("drag_only_current", "ocean_current", "thruster_gain"): [0.1, 0.2, 0.0, 0.9],
    }
    assert compare._size(pair) == 4 and compare._size(other) == 8


def test_one_name_is_no_more_than_may_be_given_by_the_first_search(in_the_drag_alone):
    asked = ["ocean_current", "drag_only_current", "drag_curve"]
    model = load("bluerov2_heavy")
    found = diagnose(model, in_the_drag_alone, effects=asked, stochastic=False, advice=False, max_effects=1)
    assert sum(len(s["effects"]) for s in found.steps) <= 1


def test_of_a_group_that_a_pair_leads_the_other_name_is_told_too(monkeypatch):
    """A current and its rival cannot be told apart; how much of the current the drag alone feels is told beside them."""
    layout = lay_out(GreyBox(small_vehicle()), [*OPEN, "tether"])
    first: Any = SimpleNamespace(effects=(), fitted=None)
    pair: Any = SimpleNamespace(effects=("drag_only_current", "ocean_current"))
    rival: Any = SimpleNamespace(effects=("tether",))
    choice = Choice("ambiguous", pair, [pair, rival], [pair, rival])
    scores = {n: SimpleNamespace(degrees=1) for n in [*OPEN, "tether"]}
    tested = SimpleNamespace(scores=scores, p_value=1e-9, alike=None, at=None)
    asked: Any = SimpleNamespace(
        usable=tuple(scores), base=(), most=3, layout=layout, say=lambda _: None,
        model=SimpleNamespace(effect_names=()), needs={}, tests=lambda _: lambda *a, **k: tested,
        chooser=lambda _: SimpleNamespace(choose=lambda *a: choice),
    )  # fmt: skip
    monkeypatch.setattr(search_round_module, "candidate_table", lambda *_: {"any": None})
    monkeypatch.setattr(search_round_module, "fill_candidate", lambda layout, table, *_: table)
    monkeypatch.setattr(search_round_module, "_what_others_leave", lambda *_: [])
    monkeypatch.setattr(search_round_module, "_finer", lambda asked, found, windows: (found, windows))
    state = search_round_module.search_round(asked, State(None, first, first))  # type: ignore[arg-type]
    assert [s["effects"] for s in state.steps] == [["ocean_current", "tether"], ["drag_only_current"]]
    assert [s["verdict"] for s in state.steps] == ["ambiguous", "named"]
    assert {*state.chosen} == {"ocean_current", "drag_only_current"}


def test_a_pair_begins_with_all_of_the_share_and_no_current(monkeypatch):
    """What the test says of a current holds for one that all terms feel."""
    layout, begun = lay_out(GreyBox(small_vehicle()), OPEN), []

    def fit(layout, windows, base, effects, **more):
        begun.append(
            (
                list(effects),
                parameters_of(more["guess"].model, ["ocean_current", "drag_only_current"]).tolist(),
            )
        )
        return SimpleNamespace(fitted=SimpleNamespace(cost=0.0))

    monkeypatch.setattr(refit_leaders, "fit_hypothesis", fit)
    current: Any = SimpleNamespace(fitted=SimpleNamespace(sigma=None, cost=1.0))
    beside = refit_leaders.Beside(layout, None, layout, [], [], current, OPEN)  # type: ignore[arg-type]
    tested: Any = SimpleNamespace(effect="ocean_current", estimate=np.array([0.3, -0.2, 0.1]))
    refit_leaders.refitted(beside, tested)
    refit_leaders.refitted(beside, tested, "drag_only_current")
    assert begun == [
        (["ocean_current"], [0.3, -0.2, 0.1, 0.0]),
        (["drag_only_current", "ocean_current"], [0.0, 0.0, 0.0, 1.0]),
    ]
