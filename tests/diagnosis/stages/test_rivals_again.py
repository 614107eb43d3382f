"""Names compared with rivals again, beside what was found or given up after them."""

from __future__ import annotations

import importlib
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.diagnosis.stages.rivals_again import compared_again
from auvnn.diagnosis.stages.state import State
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


def fit(error: float, *effects: str) -> Any:
    return SimpleNamespace(effects=effects, squared_error=lambda _: error)


class Asked:
    """What is asked, with a chooser that knows which rivals do better or as well, and writes down what it is given."""

    def __init__(self, better: Any = None, alike: Any = None) -> None:
        self.better, self.alike, self.given, self.base = better, alike or {}, [], ["inertia"]
        self.say = lambda _: None

    def chooser(self, windows: Any) -> Any:
        def in_place(taken: Any, base: Any, rivals: Any) -> Any:
            assert base == self.base
            self.given.append({n: [e.effects[-1] for e in of] for n, of in rivals.items()})
            return self.better, self.alike

        return SimpleNamespace(in_place=in_place)


def ended(*effects: str, **more: Any) -> State:
    """Return a search that ended with names, of which rivals had been fitted with and without each."""
    path = tuple(fit(9.0, *effects[: k + 1]) for k in range(len(effects)))
    tried = [
        fit(6.0, "actuation_delay"), fit(4.0, "thrust_overshoot"), fit(7.0, "fin_lag"),
        fit(3.0, "waves", "actuation_delay"), fit(2.0, "compressibility"), *path,
    ]  # fmt: skip
    first: Any = SimpleNamespace(fitted=SimpleNamespace(sigma=np.ones(18)), effects=())
    steps = [{"verdict": "named", "effects": [n], "p_value": 0.0} for n in effects]
    steps.append({"verdict": "unknown", "effects": [], "p_value": 1e-9})
    given: Any = {
        "windows": None, "first": first, "current": path[-1], "chosen": effects, "path": path,
        "tried": tuple(tried), "steps": tuple(steps), "ended": True, **more,
    }  # fmt: skip
    return State(**given)


def test_names_that_were_compared_beside_all_others_are_not_compared_again():
    asked: Any = Asked()
    assert compared_again(asked, state := ended("thruster_lag")) is state
    assert asked.given == []
    # Of several the last one has been, as far as its rivals were fitted beside the others.
    state = ended("gyro_bias", "thruster_lag")
    both = fit(1.0, "gyro_bias", "actuation_delay")
    assert compared_again(asked, state := state.but(tried=(*state.tried, both))) is state
    assert asked.given == [{"thruster_lag": ["thrust_overshoot"]}]


def test_rivals_that_left_least_are_fitted_in_the_place_of_a_name():
    asked: Any = Asked()
    assert compared_again(asked, state := ended("thruster_lag", "gyro_bias")) is state
    # Those that are confused with the lag, by their best fit.
    assert asked.given == [{"thruster_lag": ["actuation_delay", "thrust_overshoot"]}]


@pytest.mark.parametrize(
    ("more", "left"),
    [
        ({"withdrawn": ("actuation_delay",)}, ["thrust_overshoot"]),
        (
            {"groups": ((fit(1.0, "gyro_bias"), fit(1.0, "thrust_overshoot")),)},
            ["actuation_delay"],
        ),
    ],
)
def test_what_was_given_up_or_is_in_a_group_is_no_rival(more, left):
    asked: Any = Asked()
    compared_again(asked, ended("thruster_lag", "gyro_bias", **more))
    assert asked.given == [{"thruster_lag": left}]


def test_a_name_that_leads_a_group_is_compared_with_that_group():
    asked: Any = Asked()
    groups = ((fit(1.0, "thruster_lag"), fit(1.0, "thrust_overshoot")),)
    assert compared_again(asked, state := ended("thruster_lag", "gyro_bias", groups=groups)) is state
    assert asked.given == []


def test_a_name_is_compared_again_where_another_was_given_up_since():
    asked: Any = Asked()
    whole = ended("payload", "thruster_lag")
    alone = fit(9.5, "thruster_lag")
    tried = (fit(6.0, "payload", "actuation_delay"), fit(5.0, "payload", "thrust_overshoot"), *whole.path)
    state = whole.but(current=alone, chosen=("thruster_lag",), withdrawn=("payload",), tried=(*tried, alone))
    compared_again(asked, state)
    assert asked.given == [{"thruster_lag": ["thrust_overshoot", "actuation_delay"]}]


def test_the_search_goes_on_with_the_rival_that_does_better():
    taken = fit(1.0, "gyro_bias", "actuation_delay")
    asked: Any = Asked(("thruster_lag", taken))
    state = compared_again(asked, ended("thruster_lag", "gyro_bias"))
    assert not state.ended
    assert state.current is taken and state.chosen == ("gyro_bias", "actuation_delay")
    assert [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("named", ["actuation_delay"]),
        ("named", ["gyro_bias"]),
    ]
    # What has lost its place is asked for no more, so that the search comes to an end.
    assert state.withdrawn == ("thruster_lag",) and state.path[-1] is taken
    compared_again(asked, state.but(ended=True))
    assert asked.given[1:] == [{"actuation_delay": ["fin_lag"]}]


@pytest.mark.parametrize("order", [["thruster_lag", "actuation_delay"], ["actuation_delay", "thruster_lag"]])
def test_what_the_log_cannot_tell_from_a_name_is_told_with_it(order):
    whole = ended("thruster_lag", "gyro_bias")
    group = [fit(1.0, "gyro_bias", name) for name in order]
    state = compared_again(Asked(alike={"thruster_lag": [*group]}), whole)  # type: ignore[arg-type]
    # The search has ended all the same; what came after the name stays.
    assert state.ended and [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("ambiguous", order),
        ("named", ["gyro_bias"]),
        ("unknown", []),
    ]
    assert state.groups == (tuple(group),) and state.withdrawn == ()
    plainer = order[0] != "thruster_lag"
    assert state.current is (group[0] if plainer else whole.current)
    assert state.chosen == (("gyro_bias", "actuation_delay") if plainer else whole.chosen)


def test_one_plainer_rival_alone_changes_the_explanation():
    whole = ended("thruster_lag", "net_buoyancy").but(
        tried=(fit(1.0, "payload"), fit(1.0, "actuation_delay"))
    )
    late = [fit(1.0, "net_buoyancy", n) for n in ("actuation_delay", "thruster_lag")]
    heavy = [fit(1.0, "thruster_lag", n) for n in ("payload", "net_buoyancy")]
    asked: Any = Asked(alike={"thruster_lag": [*late], "net_buoyancy": [*heavy]})
    state = compared_again(asked, whole)
    assert state.current is late[0]
    assert state.groups == (tuple(late), (heavy[1], heavy[0]))
    assert [s["effects"] for s in state.steps[:2]] == [
        ["actuation_delay", "thruster_lag"],
        ["net_buoyancy", "payload"],
    ]


def test_of_names_that_one_step_gave_together_the_others_stay():
    whole = ended("thruster_lag", "gyro_bias")
    together = whole.but(
        steps=({"verdict": "named", "effects": ["thruster_lag", "gyro_bias"], "p_value": 0.0},)
    )
    group = [fit(1.0, "gyro_bias", n) for n in ("thruster_lag", "actuation_delay")]
    state = compared_again(Asked(alike={"thruster_lag": group}), together)  # type: ignore[arg-type]
    assert [(s["verdict"], s["effects"]) for s in state.steps] == [
        ("named", ["gyro_bias"]),
        ("ambiguous", ["thruster_lag", "actuation_delay"]),
    ]


def test_a_step_that_gave_a_name_up_stays_as_it_is():
    whole = ended("thruster_lag", "gyro_bias").step("withdrawn", ["thruster_lag"], 0.0)
    group = [fit(1.0, "gyro_bias", n) for n in ("thruster_lag", "actuation_delay")]
    state = compared_again(Asked(alike={"thruster_lag": group}), whole)  # type: ignore[arg-type]
    assert [(s["verdict"], s["effects"]) for s in state.steps][-1] == ("withdrawn", ["thruster_lag"])


def test_the_rival_must_explain_more_and_predict_better():
    """By a log of a lag and a buoyancy: a delay gives its place to the lag, and the lag to nothing."""
    model = GreyBox(small_vehicle())
    names = ["thruster_lag", "actuation_delay", "net_buoyancy"]
    plant = model.with_effects({"thruster_lag": {"time_constant": 0.3}, "net_buoyancy": {"force": 4.0}})
    log = make_log(plant, runs=3, duration=8.0, noise=1.0)
    layout, windows = lay_out(model, names), windows_for(model, log)
    base = [n for n in layout.names if n not in names]
    chooser = Chooser(layout, windows, lambda _: None)

    def of(*effects: str) -> Any:
        return fit_hypothesis(layout, windows, base, effects)

    lag, delay = of("thruster_lag"), of("actuation_delay")
    late = of("actuation_delay", "net_buoyancy")
    better, alike = chooser.in_place(late, base, {"actuation_delay": [lag]})
    assert better is not None and alike == {}
    name, taken = better
    assert name == "actuation_delay" and taken.effects == ("net_buoyancy", "thruster_lag")
    assert taken.fitted.model.effect("thruster_lag").theta.item() == pytest.approx(0.3, abs=0.03)
    right = of("thruster_lag", "net_buoyancy")
    assert chooser.in_place(right, base, {"thruster_lag": [delay]}) == (None, {})


def test_rivals_that_explain_as_much_are_told_with_a_name_the_plainer_one_first():
    """Of a thrust that falls with speed, a loss in proportion to speed is the plainer law."""
    model = GreyBox(small_vehicle())
    names = ["thrust_inflow_loss", "thruster_gain", "net_buoyancy"]
    log = make_log(model.with_effects({"net_buoyancy": {"force": 4.0}}), runs=3, duration=8.0, noise=1.0)
    layout, windows = lay_out(model, names), windows_for(model, log)
    base = [n for n in layout.names if n not in names]
    chooser = Chooser(layout, windows, lambda _: None)
    one, other = (fit_hypothesis(layout, windows, base, [n]) for n in names[:2])
    both = fit_hypothesis(layout, windows, base, ["thrust_inflow_loss", "net_buoyancy"])
    better, alike = chooser.in_place(both, base, {"thrust_inflow_loss": [other]})
    assert better is None and [e.effects[-1] for e in alike["thrust_inflow_loss"]] == [
        "thruster_gain",
        names[0],
    ]
    both = fit_hypothesis(layout, windows, base, ["thruster_gain", "net_buoyancy"])
    _, alike = chooser.in_place(both, base, {"thruster_gain": [one]})
    assert all(group[0].effects[-1] == name for name, group in alike.items())


@pytest.mark.parametrize(
    ("ahead", "predicts", "exchanged"), [(9.0, True, True), (9.0, False, False), (2.0, True, False)]
)
def test_a_rival_that_is_ahead_by_chance_takes_no_place(monkeypatch, ahead, predicts, exchanged):
    """Odds of a hundred are 4.6 in the logarithm; what has no place is told with the name."""
    module = importlib.import_module(Chooser.__module__)
    chooser = Chooser(None, None, lambda _: None)  # type: ignore[arg-type]
    taken, rival = (
        FittedHypothesis((n,), None, (), evidence, np.zeros(0), np.zeros(0))  # type: ignore[arg-type]
        for n, evidence in (("thruster_lag", 100.0), ("actuation_delay", 100.0 + ahead))
    )
    monkeypatch.setattr(Chooser, "_instead", lambda *_: rival)
    monkeypatch.setattr(Chooser, "_factor", staticmethod(lambda e: 1.0))
    monkeypatch.setattr(Chooser, "_settled", lambda self, best, *_: best)
    monkeypatch.setattr(module, "log_evidence", lambda layout, e, factor: e)
    monkeypatch.setattr(module, "improves_predictive_density", lambda *_: predicts)
    better, alike = chooser.in_place(taken, [], {"thruster_lag": [rival]})
    assert (better == ("thruster_lag", rival)) is exchanged and (better is None) is not exchanged
    told = [e.effects[-1] for e in alike.get("thruster_lag", [])]
    assert sorted(told) == ([] if exchanged else ["actuation_delay", "thruster_lag"])


def test_a_rival_of_two_names_is_told_with_the_nearer_one(monkeypatch):
    module = importlib.import_module(Chooser.__module__)
    chooser = Chooser(None, None, lambda _: None)  # type: ignore[arg-type]

    def explained(evidence: float, *effects: str) -> FittedHypothesis:
        return FittedHypothesis(effects, None, (), evidence, np.zeros(0), np.zeros(0))  # type: ignore[arg-type]

    taken, rival = explained(100.0, "net_buoyancy", "tether"), explained(0.0, "payload")
    ends = {
        "net_buoyancy": explained(98.0, "tether", "payload"),
        "tether": explained(99.0, "net_buoyancy", "payload"),
    }
    monkeypatch.setattr(Chooser, "_instead", lambda self, taken, base, name, rival: ends[name])
    monkeypatch.setattr(Chooser, "_factor", staticmethod(lambda e: 1.0))
    monkeypatch.setattr(module, "log_evidence", lambda layout, e, factor: e)
    _, alike = chooser.in_place(taken, [], {"net_buoyancy": [rival], "tether": [rival]})
    assert {n: [e.effects[-1] for e in of] for n, of in alike.items()} == {"tether": ["tether", "payload"]}
