"""What is asked before an effect that was taken is withdrawn."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.standard_errors import standard_errors
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.selection import prune
from auvnn.estimation.prediction_error import FitError
from auvnn.models import GreyBox
from tests.small_logs import make_log, small_vehicle


@pytest.mark.parametrize("doubtless", [True, False])
def test_a_fit_is_spent_on_what_is_uncertain_anyway_and_where_there_is_a_doubt(monkeypatch, doubtless):
    """An uncertain coefficient stays free without its name, near what was stated: a test at its null says nothing."""
    fitted: list[tuple[str, ...]] = []

    def fit(_layout, _windows, _base, effects, **_more):
        fitted.append(tuple(effects))
        raise FitError("needed")

    monkeypatch.setattr(prune, "fit_hypothesis", fit)
    monkeypatch.setattr(prune, "set_parameters", lambda *_: None)
    monkeypatch.setattr(prune, "replace", lambda *_, **__: None)
    monkeypatch.setattr(prune.Pruning, "clearly_needed", lambda *_: doubtless)
    model = SimpleNamespace(rebuilt=lambda _: None, copied_effects=lambda: None)
    layout: Any = SimpleNamespace(means={"quadratic_damping": 1.0, "net_buoyancy": 0.0})
    taken: Any = SimpleNamespace(
        effects=("quadratic_damping", "net_buoyancy", "tether"),
        fitted=SimpleNamespace(model=model, sigma=None),
    )
    windows: Any = None
    found, gone = prune.Pruning(layout, windows, lambda _: None).withdrawn(taken, ["quadratic_damping"])
    assert (found, gone) == (taken, [])
    without_drag, without_buoyancy = ("net_buoyancy", "tether"), ("quadratic_damping", "tether")
    assert fitted == ([without_drag] if doubtless else [without_drag, without_buoyancy])


def test_what_is_there_is_clearly_needed_and_what_is_not_there_is_not():
    """Half of Wald's statistic of one parameter is half of (value over standard error) squared."""
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects({"net_buoyancy": {"force": 6.0}}), runs=2, duration=12.0, noise=1.0)
    names = ["net_buoyancy", "constant_force"]
    layout, windows = lay_out(model, names), windows_for(model, log)
    base = [n for n in layout.names if n not in names]
    found = fit_hypothesis(layout, windows, base, names)
    asked = prune.Pruning(layout, windows, lambda _: None)
    assert asked.clearly_needed(found, "net_buoyancy") and not asked.clearly_needed(found, "constant_force")
    alone = fit_hypothesis(layout, windows, base, ["net_buoyancy"])
    (column,) = layout.places(alone.names)["net_buoyancy"]
    (std,), _ = standard_errors(alone, np.array([column]))
    half = 0.5 * (alone.fitted.theta[column] / std) ** 2
    for share, wanted in ((0.5, True), (2.0, False)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(prune, "BEYOND_DOUBT", share * half)
            assert asked.clearly_needed(alone, "net_buoyancy") is wanted


@pytest.mark.parametrize(
    ("beside", "ahead", "gone"),
    [("munk_moment", 4.0, ["body_lift"]), ("munk_moment", 5.0, []), ("net_buoyancy", 4.0, [])],
)
def test_what_contains_another_name_must_be_likelier_by_the_odds_of_a_name(monkeypatch, beside, ahead, gone):
    """Odds of a hundred to one, 4.6 in the logarithm; any other name stays where it is likelier at all."""
    model = SimpleNamespace(rebuilt=lambda _: None, copied_effects=lambda: None)
    fitted = SimpleNamespace(model=model, sigma=None)

    def explained(effects: tuple[str, ...], evidence: float) -> Any:
        return SimpleNamespace(effects=effects, evidence=evidence, fitted=fitted)

    monkeypatch.setattr(
        prune, "fit_hypothesis", lambda _, __, ___, effects, **____: explained(effects, 10.0 - ahead)
    )
    monkeypatch.setattr(prune, "set_parameters", lambda *_: None)
    monkeypatch.setattr(prune, "replace", lambda *_, **__: None)
    monkeypatch.setattr(prune, "log_evidence", lambda _, explanation, __: explanation)
    monkeypatch.setattr(prune, "improves_predictive_density", lambda *_: True)
    monkeypatch.setattr(prune.Pruning, "clearly_needed", lambda *_: False)
    monkeypatch.setattr(prune.Pruning, "_factor", lambda *_: 1.0)
    monkeypatch.setattr(prune.Pruning, "_settled", lambda _, found, *__: explained(found.effects, 10.0))
    names = ("body_lift", beside, "tether")
    layout: Any = SimpleNamespace(means=dict.fromkeys(names, 0.0))
    windows: Any = None
    found, told = prune.Pruning(layout, windows, lambda _: None).withdrawn(explained(names, 10.0), [])
    assert told == gone and found.effects == tuple(n for n in names if n not in gone)
