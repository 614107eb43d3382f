"""What could not be told from a name is asked for again beside it: both may be missing; and plainer causes in others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law import search as module
from auvnn.diagnosis.noise_law.rounds import name_after_name
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.leader_fits import LeaderFits
from auvnn.diagnosis.noise_law.rounds.leaders import contained_in
from tests.diagnosis.noise_law.scripted import found, scripted


def tied_at_first(monkeypatch, further: Any) -> tuple[Any, list[Any]]:
    """Return a scripted search whose first fits, and whatever ends in the first two of a round, are alike."""
    asked, rounds = scripted(monkeypatch, further)
    monkeypatch.setattr(name_after_name, "tied", lambda _, good, before: good[:2])
    monkeypatch.setattr(name_after_name, "decided", lambda good, *_: good)
    monkeypatch.setattr(module, "those_that_lose", lambda *_: set())
    asked.rest = lambda path: 0.0
    return asked, rounds


def test_an_effect_that_could_not_be_told_from_a_name_is_named_where_the_log_needs_both(monkeypatch):
    further = {
        (): [found(10.0, "payload"), found(9.0, "waves")],
        ("payload",): [found(500.0, "payload", "waves")],
        ("payload", "waves"): [],
    }
    asked, _ = tied_at_first(monkeypatch, further)
    asked_for: list[list[str]] = []
    asked._tested = lambda current, remaining, *_: (
        asked_for.append(remaining) or SimpleNamespace(p_value=0.0, scores={})
    )
    ended = asked.run(found(-1000.0), [], 4)
    assert [(s["verdict"], s["effects"]) for s in ended.steps] == [
        ("named", ["payload"]), ("named", ["waves"]),
    ]  # fmt: skip
    assert ended.groups == [] and ended.last.effects == ("payload", "waves")
    # The last two: whether anything is left beside both, and what that would move.
    assert "waves" in asked_for[-3] and "waves" not in asked_for[-2] == asked_for[-1]


def test_one_of_three_that_is_needed_leaves_the_others_tied(monkeypatch):
    further = {
        (): [found(10.0, "payload"), found(9.0, "waves"), found(8.0, "trapped_water")],
        ("payload",): [found(500.0, "payload", "waves"), found(499.0, "payload", "trapped_water")],
        ("payload", "waves"): [],
    }
    asked, _ = tied_at_first(monkeypatch, further)
    monkeypatch.setattr(name_after_name, "tied", lambda _, good, before: good)
    ended = asked.run(found(-1000.0), [], 4)
    # The third is in a group already, and in no second one.
    assert [(s["verdict"], s["effects"]) for s in ended.steps] == [
        ("ambiguous", ["payload", "trapped_water"]), ("named", ["waves"]),
    ]  # fmt: skip
    assert [[e.effects[-1] for e in g] for g in ended.groups] == [["payload", "trapped_water"]]


def explained(evidence: float, name: str, **values: float) -> Any:
    effect = SimpleNamespace(values=lambda: values)
    fitted = SimpleNamespace(model=SimpleNamespace(effect=lambda _: effect))
    return SimpleNamespace(
        name=name, evidence=evidence, explanation=SimpleNamespace(fitted=fitted, effects=(name,))
    )


LAYOUT: Any = SimpleNamespace(described=lambda _: [SimpleNamespace(name="time_constant", null=0.0)])


@pytest.mark.parametrize(
    ("evidence", "open_to", "expected"),
    [(1.0, {"thruster_lag"}, {"thruster_lag": [2.5]}), (-1.0, {"thruster_lag"}, {}), (1.0, {"waves"}, {})],
)
def test_a_lag_begins_where_an_overshoot_that_explains_something_has_ended(evidence, open_to, expected):
    others = [
        explained(5.0, "payload", mass=2.0),
        explained(evidence, "thrust_overshoot", time_constant=2.5, X=-1.0),
    ]
    begins = contained_in(LAYOUT, others, explained(0.0, ""), open_to)
    assert {n: v.tolist() for n, v in begins.items()} == expected


@pytest.mark.parametrize(("more", "expected"), [([], {"munk_moment": [1.0]}), (["munk_moment"], {})])
def test_what_shares_no_parameter_with_what_contains_it_is_fitted_once(more, expected):
    """The Munk moment is a part of a lift, in other terms: it begins at its null, as it has if it was fitted."""
    layout: Any = SimpleNamespace(described=lambda _: [SimpleNamespace(name="pitch", null=1.0)])
    others = [explained(5.0, n, Muw=-3.0) for n in ("body_lift", *more)]
    begins = contained_in(layout, others, explained(0.0, ""), {"munk_moment"})
    assert {n: v.tolist() for n, v in begins.items()} == expected


@pytest.mark.parametrize(("gains", "expected"), [(30.0, 30.0), (5.0, 8.0), (None, 8.0)])
def test_the_plainer_cause_is_kept_where_that_beginning_leads_further_than_its_null(
    monkeypatch, gains, expected
):
    """From its null the lag has gained 8; from the values of an overshoot it gains more, less, or cannot be fitted."""
    null, begun = explained(0.0, ""), []
    from_null = explained(8.0, "thruster_lag", time_constant=0.1)
    fits = LeaderFits(LAYOUT, None, lambda _: None)  # type: ignore[arg-type]
    fits.known[id(null), "thruster_lag"] = null, from_null
    fits.known[id(null), "thrust_overshoot"] = null, explained(20.0, "thrust_overshoot", time_constant=2.5)
    monkeypatch.setattr(LeaderFits, "_worth", lambda *_: ["thrust_overshoot", "thruster_lag"])
    monkeypatch.setattr(LeaderFits, "_known", lambda *_: {})

    def fitted(self: Any, begins: Any, name: str, at: Any) -> Any:
        begun.append((name, [b.tolist() for b in begins]))
        return None if gains is None else explained(gains, name)

    monkeypatch.setattr(LeaderFits, "_from", fitted)
    score = SimpleNamespace(p_value=1.0, degrees=1, evidence=0.0)
    tested: Any = SimpleNamespace(scores={"thrust_overshoot": score, "thruster_lag": score})
    told = fits.leading(Round(tested, null, [], ["payload"]), [], 5.0, 0.01)
    assert begun == [("thruster_lag", [[2.5]])]
    assert {h.name: h.evidence for h in told} == {"thrust_overshoot": 20.0, "thruster_lag": expected}
    assert np.all(np.diff([h.evidence for h in told]) <= 0.0)
