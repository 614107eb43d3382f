"""What is asked before an effect that was taken is withdrawn."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.selection import prune
from auvnn.estimation.prediction_error import FitError


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
