"""What does nothing by itself is fitted, judged and named together with what it acts beside."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.hypothesis import p_value_of
from auvnn.diagnosis.noise_law.rounds import leader_fits
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.beside_all_names import refitted
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.noise_law.rounds.looking_ahead import Branch, shared
from auvnn.diagnosis.noise_law.rounds.path import Path
from auvnn.diagnosis.noise_law.search import _to_ask
from auvnn.diagnosis.selection.acting_together import comes_with, worth_fitting_together
from auvnn.diagnosis.selection.model_comparison import ODDS
from auvnn.effects.acting_beside import last_names
from auvnn.estimation.prediction_error import FitError
from auvnn.estimation.priors import parameters_of
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.scripted import found, scripted
from tests.small_logs import small_vehicle

WATER = ["ocean_current", "current_shear", "waves"]
OPEN = [*WATER, "drag_only_current", "payload"]
LEFT_OUT = ["added_mass_coriolis"]


def test_where_a_simulators_simplification_was_found_the_other_one_is_asked_for():
    assert [comes_with(n, LEFT_OUT, OPEN) for n in WATER] == [["drag_only_current"]] * 3
    assert comes_with("payload", LEFT_OUT, OPEN) == []
    # Beside another name, where water moves already, and where it may not be named, nothing is.
    assert comes_with("ocean_current", ["payload"], OPEN) == []
    assert comes_with("current_shear", [*LEFT_OUT, "ocean_current"], OPEN) == []
    assert comes_with("ocean_current", LEFT_OUT, WATER) == []
    assert comes_with("ocean_current", LEFT_OUT, OPEN, ["linear_damping", "waves"]) == []


def test_before_any_name_what_moves_the_water_is_fitted_with_it_where_it_is_fitted_anyway():
    """With a current in the drag alone, as in simulators, one that all terms feel explains next to nothing."""
    assert [comes_with(n, [], OPEN) for n in [*WATER, "payload"]] == [["drag_only_current"]] * 3 + [[]]
    assert comes_with("ocean_current", [], OPEN, ["waves"]) == comes_with("ocean_current", [], WATER) == []
    layout = lay_out(GreyBox(small_vehicle()), OPEN)
    assert worth_fitting_together(layout, [], OPEN) == []


def test_of_a_wave_only_a_test_says_where_its_fit_begins():
    layout = lay_out(GreyBox(small_vehicle()), OPEN)
    assert worth_fitting_together(layout, LEFT_OUT, OPEN) == ["ocean_current", "current_shear"]
    assert worth_fitting_together(layout, ["payload"], OPEN) == []


@pytest.mark.parametrize(
    ("chosen", "expected"), [(LEFT_OUT, ["ocean_current", "current_shear"]), (["tether"], [])]
)
def test_they_are_fitted_whatever_their_tests_promise(monkeypatch, chosen, expected):
    asked: list[str] = []
    monkeypatch.setattr(LeaderFits, "_one", lambda self, name, at, known: asked.append(name))
    layout = lay_out(GreyBox(small_vehicle()), [*LEFT_OUT, *OPEN])
    scores = {n: SimpleNamespace(degrees=1, evidence=-9.0, gain=0.0, p_value=1.0) for n in OPEN}
    at: Any = Round(SimpleNamespace(scores=scores), None, [], chosen)  # type: ignore[arg-type]
    LeaderFits(layout, None, lambda _: None).leading(at, [], 100.0, 0.01)  # type: ignore[arg-type]
    assert asked == expected


@pytest.mark.parametrize("chosen", [LEFT_OUT, []])
@pytest.mark.parametrize(("more", "together"), [(ODDS + 1.0, True), (ODDS - 1.0, False)])
def test_two_names_stand_where_they_are_likelier_by_what_a_name_needs(monkeypatch, more, together, chosen):
    monkeypatch.setattr(leader_fits, "within_record", lambda *_: True)
    layout, begun = lay_out(GreyBox(small_vehicle()), [*LEFT_OUT, *OPEN]), []

    def from_null(layout, model, current, base, effects, least):
        begun.append((effects, parameters_of(model, ["ocean_current", "drag_only_current"]).tolist()))
        both = "drag_only_current" in effects
        return SimpleNamespace(evidence=50.0 + (more if both else 0.0), explanation=tuple(effects))

    fits: Any = SimpleNamespace(windows=None, from_null=from_null)
    scores = {n: SimpleNamespace(estimate=np.zeros(3)) for n in OPEN}
    tested: Any = SimpleNamespace(scores=scores, at=layout)
    current: Any = SimpleNamespace(evidence=0.0)
    best: Any = LeaderFits(layout, fits, lambda _: None)._one(
        "ocean_current", Round(tested, current, [], chosen), None
    )
    alone, pair = [*chosen, "ocean_current"], [*chosen, "drag_only_current", "ocean_current"]
    assert begun == [(alone, [0.0, 0.0, 0.0, 0.0]), (pair, [0.0, 0.0, 0.0, 1.0])]
    assert list(best.explanation) == (pair if together else alone)


def begun_at(name, estimate, places=9.0, base=()):
    """Return from which values an effect is fitted beside missing Coriolis forces, alone and with what acts beside it."""
    layout, begun = lay_out(GreyBox(small_vehicle()), [*LEFT_OUT, *OPEN]), []

    def from_null(layout, model, current, base, effects, least):
        begun.append((effects[-2:], parameters_of(model, [name]).tolist()))
        raise FitError("no")

    scores = {n: SimpleNamespace(estimate=np.array(estimate)) for n in OPEN}
    tested: Any = SimpleNamespace(scores=scores, at=layout)
    current: Any = SimpleNamespace(evidence=0.0)
    at = Round(tested, current, list(base), LEFT_OUT, places=places)
    LeaderFits(layout, SimpleNamespace(windows=None, from_null=from_null), lambda _: None)._one(
        name, at, None
    )  # type: ignore[arg-type]
    return begun


def test_a_wave_is_fitted_with_it_from_the_shape_that_its_test_has_found():
    alone, together = begun_at("waves", [0.2, 1.7, 0.4, 2.0])
    assert alone == (["added_mass_coriolis", "waves"], [0.0, 1.7, 0.4, 2.0])
    assert together == (["drag_only_current", "waves"], [0.0, 1.7, 0.4, 2.0])


def test_two_names_are_no_more_than_may_be_given():
    assert len(begun_at("ocean_current", [0.0] * 3, places=2)) == 2
    assert len(begun_at("ocean_current", [0.0] * 3, places=1)) == 1
    # Water that the model has already.
    assert len(begun_at("ocean_current", [0.0] * 3, base=["current_shear"])) == 1


def test_a_share_that_lost_its_current_is_asked_for_though_it_came_last():
    def asked(*chosen: str) -> list[str]:
        return _to_ask(Path(None, list(chosen)))  # type: ignore[arg-type]

    assert asked("payload", "waves") == ["payload"]
    assert asked("payload", "ocean_current", "drag_only_current") == [
        "payload", "ocean_current", "drag_only_current",
    ]  # fmt: skip


def test_a_rival_comes_with_what_acts_beside_it_only():
    both = ("payload", "drag_only_current", "waves")
    assert last_names(both) == ["drag_only_current", "waves"]
    assert last_names(("drag_only_current", "payload")) == ["payload"]
    layout = lay_out(GreyBox(small_vehicle()), [*OPEN, "tether"])
    values = {"drag_only_current": {"share": 0.7}, "waves": {"amplitude": 0.3}}
    model = GreyBox(small_vehicle()).with_effects({n: values.get(n, {}) for n in (*OPEN, "tether")})
    seen: list[Any] = []

    def from_null(layout, model, current, base, effects, least, held):
        seen.append((effects, parameters_of(model, ["drag_only_current", "waves"])[:2].tolist()))

    fitted = SimpleNamespace(model=layout.model)
    current: Any = SimpleNamespace(
        evidence=0.0, explanation=SimpleNamespace(effects=("payload", "tether"), fitted=fitted)
    )
    rival: Any = SimpleNamespace(effects=both, fitted=SimpleNamespace(model=model))
    refitted(layout, SimpleNamespace(from_null=from_null), current, [], "tether", rival)  # type: ignore[arg-type]
    assert seen == [(["payload", "drag_only_current", "waves"], [0.7, 0.3])]


def test_a_pair_of_which_one_was_dropped_is_not_brought_back():
    here: Any = SimpleNamespace(evidence=0.0)
    looks: Any = LeaderFits(None, None, print)  # type: ignore[arg-type]
    pair = found(90.0, *LEFT_OUT, "drag_only_current", "ocean_current")
    looks.known[id(here), "ocean_current"] = here, pair
    scores = {n: None for n in OPEN}
    assert looks._beside(Round(SimpleNamespace(scores=scores), here, [], LEFT_OUT)) == [pair]  # type: ignore[arg-type]
    del scores["drag_only_current"]
    assert looks._beside(Round(SimpleNamespace(scores=scores), here, [], LEFT_OUT)) == []  # type: ignore[arg-type]


def test_both_are_names_each_in_a_step_of_its_own(monkeypatch):
    three = ("payload", "thrust_asymmetry", "waves")
    further = {
        (): [found(10.0, "payload")],
        ("payload",): [found(500.0, *three)],
        ("payload", "waves", "thrust_asymmetry"): [],
    }
    asked, rounds = scripted(monkeypatch, further)
    ended = asked.run(found(-1000.0), [], 4)
    told = ended.steps
    assert [s["effects"] for s in told] == [["payload"], ["waves"], ["thrust_asymmetry"]]
    assert {s["verdict"] for s in told} == {"named"}
    # Whoever goes on from there finds them in the same order.
    assert asked.averaged_with == [[]] and ended.last.effects == ("payload", "waves", "thrust_asymmetry")
    assert rounds[0].places == 4 and rounds[-1].places == 1
    # Neither is asked for again.
    assert list(rounds[-1].chosen) == ["payload", "waves", "thrust_asymmetry"]


def test_chance_has_the_parameters_of_both():
    layout: Any = SimpleNamespace(columns={"a": range(1), "b": range(3), "c": range(2)})

    def at(misfit: float, *effects: str) -> Any:
        return SimpleNamespace(misfit=misfit, name=effects[-1], explanation=SimpleNamespace(effects=effects))

    before = at(100.0, "a")
    assert p_value_of(layout, at(80.0, "a", "b"), before) == pytest.approx(chi2.sf(20.0, 3))
    assert p_value_of(layout, at(80.0, "a", "c", "b"), before) == pytest.approx(chi2.sf(20.0, 5))
    # A rival in the place of a name counts by its own.
    assert p_value_of(layout, at(80.0, "c"), before) == pytest.approx(chi2.sf(20.0, 2))


def test_a_pair_with_a_third_effect_is_no_pair_of_the_other_branch():
    one, other = found(10.0, "payload"), found(9.0, "waves")
    two, three = found(30.0, "payload", "waves"), found(40.0, "payload", "thrust_asymmetry", "waves")
    branches = [Branch(one, one, (two,)), Branch(other, other, ())]
    assert [h.explanation.effects for _, h in shared(branches)] == [("waves", "payload")]
    assert shared([Branch(one, one, (three,)), Branch(other, other, ())]) == []
