"""What was taken first must still be needed once more is there: stand-ins go, causes stay."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis, log_evidence
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.diagnosis.selection.model_comparison import ModelComparison
from auvnn.estimation.priors import set_parameters
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle

LIGHT, PUSH = {"net_buoyancy": {"force": 6.0}}, {"constant_force": {"Y": 5.0}}
NAMES = ["constant_force", "net_buoyancy"]


@pytest.fixture(scope="module")
def model():
    return GreyBox(small_vehicle())


def logged(model, hidden):
    return make_log(model.with_effects(hidden), runs=3, duration=8.0, noise=1.0)


@pytest.fixture(scope="module")
def two(model):
    return logged(model, {**LIGHT, **PUSH})


def asked(model, log):
    """Return who asks, and the explanation with both effects in it, the stand-in first."""
    layout, windows = lay_out(model, NAMES), windows_for(model, log)
    base = [n for n in layout.names if n not in NAMES]
    return Chooser(layout, windows, lambda words: None), base, fit_hypothesis(layout, windows, base, NAMES)


def test_an_effect_that_is_not_there_is_withdrawn_once_the_cause_is_in_the_model(model):
    chooser, base, both = asked(model, logged(model, LIGHT))
    left, gone = chooser.withdrawn(both, base)
    assert gone == ["constant_force"] and left.effects == ("net_buoyancy",)
    assert left.fitted.model.effect("net_buoyancy").theta.item() == pytest.approx(6.0, abs=0.2)


def test_two_effects_that_are_there_both_stay(model, two):
    chooser, base, both = asked(model, two)
    left, gone = chooser.withdrawn(both, base)
    assert gone == [] and left is both


def test_a_withdrawn_effect_is_told_and_not_counted_as_missing(model, two, monkeypatch):
    plain = diagnose(model, two, NAMES, stochastic=False)
    assert set(plain.missing) == set(NAMES)

    def all_gone(self, taken, base):
        return fit_hypothesis(self.layout, self.windows, base, taken.effects[1:]), [taken.effects[0]]

    monkeypatch.setattr(Chooser, "withdrawn", all_gone)
    # What is left without the one that was taken away is no stand-in here, but the purpose.
    monkeypatch.setattr("auvnn.diagnosis.stages.what_is_left.PARTIAL", 2.0)
    found = diagnose(model, two, NAMES, stochastic=False)
    assert found.missing == [plain.missing[1]]
    assert [s["verdict"] for s in found.steps][:3] == ["named", "named", "withdrawn"]
    assert any(line.startswith(f"Withdrawn: {plain.missing[0]}") for line in found.story)
    assert not any(line.startswith(f"Missing: {plain.missing[0]}") for line in found.story)


def test_the_values_told_are_those_of_the_fit_with_all_that_was_found(model, two):
    found = diagnose(model, two, NAMES, stochastic=False)
    assert [s["verdict"] for s in found.steps][:2] == ["named", "named"], (
        "one after the other, or this says nothing"
    )
    told = {c["effect"]: c["parameters"] for c in found.candidates}
    final = found.explanation.fitted.model
    for name in NAMES:
        for p, value in final.effect(name).values().items():
            assert told[name][p]["value"] == pytest.approx(value, rel=1e-12)
    for name, p, truth in (("net_buoyancy", "force", 6.0), ("constant_force", "Y", 5.0)):
        assert abs(told[name][p]["value"] - truth) < 4 * told[name][p]["std"] < 0.5


def test_two_effects_that_do_as_badly_alone_are_named_together(model, two, monkeypatch):
    """As if neither were ahead of the other; alone they leave what both together explain."""
    monkeypatch.setattr(ModelComparison, "told_apart", lambda self, best, other: False)
    monkeypatch.setattr(sys.modules[Chooser.__module__], "REACH", np.inf)
    found = diagnose(model, two, NAMES, stochastic=False)
    assert found.steps[0]["verdict"] == "named" and set(found.steps[0]["effects"]) == set(NAMES)
    assert set(found.missing) == set(NAMES)


def test_every_rival_is_tried_together_with_the_best(model, two, monkeypatch):
    """A rival that explains the same must not hide another cause in the same group."""
    chooser, base, both = asked(model, two)
    best, same, other = (
        SimpleNamespace(effects=(n,), evidence=100.0) for n in ("tether", "waves", "payload")
    )
    compare: Any = SimpleNamespace(standing=lambda *_: (best, [same, other]), told_apart=lambda *_: False)
    monkeypatch.setattr(Chooser, "rivals", property(lambda self: compare))
    monkeypatch.setattr(Chooser, "_factor", staticmethod(lambda e: 1.0))
    module = sys.modules[Chooser.__module__]
    monkeypatch.setattr(module, "log_evidence", lambda layout, e, factor: e)
    monkeypatch.setattr(module, "improves_predictive_density", lambda *_: True)
    monkeypatch.setattr(Chooser, "_without", lambda *_: None)
    tried: list[str] = []

    def joined(self: Any, one: Any, rival: Any, *_: Any) -> Any:
        tried.append(rival.effects[-1])
        return both if rival is other else None

    monkeypatch.setattr(Chooser, "_joined", joined)
    first = SimpleNamespace(evidence=0.0)
    choice = chooser._among([best, same, other], set(), chooser.layout, base, first)  # type: ignore[list-item,arg-type]
    assert tried == ["waves", "payload"] and choice.verdict == "named" and choice.best is both


# Six forces of which none alone is much, so that what they might have been counts against them.
SPREAD = {"X": 2.7, "Y": -2.7, "Z": 5.4, "K": 0.27, "M": -0.27, "N": 0.54}


def standing(model, log):
    """Return who asks, all explanations by falling evidence, the one to take, and those that it does not refute."""
    layout, windows = lay_out(model, NAMES), windows_for(model, log)
    base = [n for n in layout.names if n not in NAMES]
    chooser = Chooser(layout, windows, lambda words: None)
    each = [log_evidence(layout, fit_hypothesis(layout, windows, base, [n]), 1.0) for n in NAMES]
    each.sort(key=lambda e: -e.evidence)
    return each, *chooser.rivals.standing(each, layout, base, 1.0)


def test_evidence_gives_no_name_to_what_the_data_refute(model):
    log = logged(model, {"constant_force": SPREAD})
    each, best, others = standing(model, log)
    assert each[0].effects == ("net_buoyancy",), "the plainer one leads by evidence, or this says nothing"
    assert best.effects == ("constant_force",) and others == []
    assert diagnose(model, log, NAMES).missing == ["constant_force"]


def test_a_better_fit_by_more_parameters_refutes_nothing_that_is_needed_beside_it(model, two):
    each, best, others = standing(model, two)
    assert best is each[0] and len(others) == 1
    each, best, others = standing(model, logged(model, LIGHT))
    assert best.effects == ("net_buoyancy",) and [e.effects for e in others] == [("constant_force",)]


def test_an_effect_that_its_fit_takes_back_to_its_null_is_not_named(model, monkeypatch):
    log = logged(model, LIGHT)
    assert diagnose(model, log, NAMES, stochastic=False).missing == ["net_buoyancy"]
    settled = Chooser._settled

    def nothing(self, best, at, base):
        found = settled(self, best, at, base)
        if found.effects[-1] == "net_buoyancy":
            at_null = found.fitted.model.rebuilt(found.fitted.model.copied_effects())
            set_parameters(at_null, ["net_buoyancy"], np.zeros(1))
            return replace(found, fitted=replace(found.fitted, model=at_null))
        return found

    monkeypatch.setattr(Chooser, "_settled", nothing)
    assert "net_buoyancy" not in diagnose(model, log, NAMES, stochastic=False).missing


def test_an_effect_that_its_fit_takes_out_of_the_log_is_not_named(model, monkeypatch):
    seen: list[str] = []

    def outside(found, windows):
        seen.append(found.effects[-1])
        return seen[-1] != "net_buoyancy"

    monkeypatch.setattr("auvnn.diagnosis.selection.choose.within_record", outside)
    found = diagnose(model, logged(model, LIGHT), NAMES, stochastic=False)
    assert "net_buoyancy" in seen and "net_buoyancy" not in found.missing
