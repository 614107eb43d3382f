"""Names together with a stochastic force, on small logs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.noise_law import search
from auvnn.diagnosis.noise_law.hypothesis import tied
from auvnn.diagnosis.noise_law.predicted_by_inputs import InputPrediction
from auvnn.diagnosis.noise_law.search import ForceSearch
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle

CANDIDATES = ["net_buoyancy", "thruster_gain", "thruster_lag", "added_mass", "gyro_bias"]
RMS, TIME = np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5]), 1.0


def said(hidden, seed=1, rms=RMS):
    model = GreyBox(small_vehicle())
    plant = model.with_effects(hidden) if hidden else model
    log = wandering_log(plant, rms, TIME, runs=2, duration=40.0, seed=seed)
    return diagnose(model, log, CANDIDATES, advice=False, whiteness=False, stochastic=True, max_effects=1)


@pytest.mark.long
def test_an_effect_is_named_and_the_force_beside_it_told():
    found = said({"net_buoyancy": {"force": 8.0}})
    assert found.verdict == "named" and found.missing == ["net_buoyancy"]
    assert {"X", "Y", "Z"} <= found.stochastic["force"].keys()
    for axis in "XYZ":
        assert found.stochastic["force"][axis]["rms"] == pytest.approx(4.0, rel=0.3)
        assert 0.4 < found.stochastic["force"][axis]["correlation_time"] < 2.5
    assert any("stochastic force" in line for line in found.story)
    parameters = found.candidates[0]["parameters"]["force"]
    assert parameters["value"] == pytest.approx(8.0, abs=4 * parameters["std"])


@pytest.mark.long
def test_a_force_alone_has_no_name():
    found = said({}, seed=2)
    assert found.missing == [] and found.verdict == "unknown" and found.stochastic["force"]


@pytest.mark.long
def test_without_a_force_the_answer_is_the_plain_search():
    found = said({"net_buoyancy": {"force": 8.0}}, rms=np.zeros(6))
    assert found.missing == ["net_buoyancy"] and "force" not in found.stochastic


def hypothesis(name, misfit, evidence=None):
    """Return as much of a hypothesis as a comparison looks at."""
    return SimpleNamespace(name=name, misfit=misfit, evidence=-0.5 * misfit if evidence is None else evidence)


COLUMNS: Any = SimpleNamespace(
    columns={
        "added_mass": range(6),
        "trapped_water": range(1),
        "net_buoyancy": range(1),
        "thruster_lag": range(8),
    }
)


def names_of(good, before=10000.0):
    return [h.name for h in tied(COLUMNS, good, hypothesis("", before))]


def test_what_is_known_to_be_confused_and_explains_nearly_as_much_is_tied():
    best, other = hypothesis("added_mass", 5000.0), hypothesis("trapped_water", 5200.0)
    assert names_of([best, other]) == ["added_mass", "trapped_water"]
    # Beyond a twentieth of the gain it is refuted; and what is not known to be confused is refuted much earlier.
    assert names_of([best, hypothesis("trapped_water", 5300.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5200.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5000.5)]) == ["added_mass", "net_buoyancy"]


def test_the_nearly_as_good_do_not_make_a_group_too_large():
    good = [hypothesis("added_mass", 5000.0), hypothesis("net_buoyancy", 5000.5)]
    assert names_of([*good, hypothesis("trapped_water", 5100.0), hypothesis("thruster_lag", 5150.0)]) == [
        "added_mass",
        "net_buoyancy",
        "trapped_water",
    ]


class Search(ForceSearch):
    """As much of a search as decides which of the likely explanations cost enough."""

    def __init__(self, **given: Any) -> None:
        """Look at the cost unless told otherwise."""
        vars(self).update(
            {"ignores_cost": False, "tolerance": Tolerance(), "log": None, "scale": None, **given}
        )


def paying(costs, monkeypatch, **given):
    """Return which of some explanations, each ten in evidence after the one before it, are taken at these costs."""
    likely = [hypothesis(name, 100.0 + 20.0 * k) for k, name in enumerate(costs)]
    monkeypatch.setattr(search, "free_running_cost", lambda h, *_: costs[h.name])
    return [h.name for h in Search(**given)._paying(likely, hypothesis("", 1e4), 0.5)]


def test_nothing_is_named_where_the_likeliest_makes_free_running_worse(monkeypatch):
    assert paying({"tether": 0.2, "waves": 0.01}, monkeypatch) == ["tether"]
    # One that costs too little to be given does not stand in the way of another one; nor does one that is less likely.
    assert paying({"waves": 0.01, "tether": 0.2}, monkeypatch) == ["tether"]
    assert paying({"tether": 0.2, "waves": -0.2}, monkeypatch) == ["tether"]
    assert paying({"waves": -0.2, "tether": 0.2}, monkeypatch) == []
    assert paying({"waves": -0.2, "tether": 0.2}, monkeypatch, ignores_cost=True) == ["waves", "tether"]


@pytest.mark.parametrize(
    ("further", "predicted", "expected"),
    [
        ("constant_force", 0.3, True),
        ("constant_force", 0.05, False),
        ("constant_force", None, False),
        # Not known to be confused with what was named before it.
        ("gyro_bias", 0.3, False),
    ],
)
def test_a_further_name_that_takes_up_what_an_earlier_one_gets_wrong_ends_the_search(
    further, predicted, expected, monkeypatch
):
    told = None if predicted is None else InputPrediction("X", "u", 0.5, predicted)
    monkeypatch.setattr(search, "predicted_by_inputs", lambda *_: told)
    monkeypatch.setattr(search, "replace", lambda *_, **__: None)
    law = SimpleNamespace(estimate=SimpleNamespace(law=object()), weighed=None, name=further)
    assert Search(windows=None)._takes_up(law, ["thrust_asymmetry"]) is expected  # type: ignore[arg-type]
