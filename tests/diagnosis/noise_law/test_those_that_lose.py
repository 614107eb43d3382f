"""Effects that could not be told apart, compared beside all names that were found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from auvnn.diagnosis.noise_law.rounds import beside_all_names as module
from auvnn.diagnosis.noise_law.rounds.beside_all_names import (
    loses,
    that_leads_instead,
    those_that_lose,
)
from auvnn.diagnosis.selection.rivals import without_lost
from tests.diagnosis.noise_law.stand_ins import explanation, fit, one_by_one, worth


@pytest.mark.parametrize(
    ("short", "rest", "predicted", "expected"),
    [
        (12.0, 3.0, True, True),
        (12.0, 5.0, True, True),
        # As likely as the leader but for a factor of ninety, and less short than another effect would still gain.
        (4.5, 0.0, True, False),
        (12.0, 13.0, True, False),
        (12.0, 3.0, False, False),
    ],
)
def test_a_rival_loses_by_more_than_the_model_is_known_to_be_wrong(
    monkeypatch, short, rest, predicted, expected
):
    asked: list[Any] = []

    def better(after, before, least, *, ranks):
        asked.append((after.evidence, before.evidence, least, ranks))
        return predicted

    monkeypatch.setattr(module, "predicts_better", better)
    assert loses(worth(short), worth(0.0), rest, 0) is expected
    # Where no further effect gains odds of a hundred nothing says that the model is wrong: two standard errors do.
    assert all(given == (short, 0.0, 3.0 if rest > 4.7 else 2.0, False) for given in asked)


@pytest.mark.parametrize(
    ("short", "gained", "extra", "expected"),
    [
        # A payload of twelve parameters that fits as well as a buoyancy of one, and better by chance.
        (21.0, 6.4, 11, True),
        (21.0, -9.1, 11, True),
        # It fits worse, by odds of a hundred: it does not contain the buoyancy, or its fit has not come so far.
        (21.0, -9.3, 11, False),
        (400.0, -300.0, 11, False),
        # Better than by chance: the 0.01 quantile of chi-squared with eleven degrees of freedom is 24.7.
        (21.0, 24.6, 11, True),
        (21.0, 24.8, 11, False),
        # As likely, or short by less than a further effect still gains.
        (4.5, 6.4, 11, False),
        (12.9, 6.4, 11, False),
        # No more parameters than the one that leads: runs left out decide.
        (21.0, 6.4, 0, False),
    ],
)
def test_a_rival_that_contains_the_leader_loses_by_evidence(monkeypatch, short, gained, extra, expected):
    monkeypatch.setattr(module, "predicts_better", lambda *_, **__: False)
    leader, rival = worth(short), worth(0.0)
    leader.misfit, rival.misfit = 1000.0, 1000.0 - gained
    assert loses(leader, rival, 13.0 if short < 13.0 else 1.5, extra) is expected


@pytest.mark.parametrize(
    ("short", "gained", "extra", "rest", "expected"),
    [
        # A lift of four numbers in the place of a Munk moment of two: both further ones are seen to be nothing.
        (6.1, 0.9, 2, 308.8, True),
        (4.7, 0.9, 2, 308.8, True),
        (4.5, 0.9, 2, 308.8, False),
        # They gain something; whether that is a lift or what the model gets wrong, the log cannot say.
        (6.1, 9.3, 2, 308.8, False),
        # Of a payload's eleven the log would not have seen a tenth of what is plausible of each: 11 ln 10 is 25.3.
        (25.2, 6.4, 11, 308.8, False),
        (25.4, 6.4, 11, 308.8, True),
        # Where a further effect gains less than that, this much is enough, as before.
        (14.0, 6.4, 11, 13.0, True),
        # What fits worse is judged by what is still unexplained.
        (25.4, -9.3, 11, 308.8, False),
    ],
)
def test_further_parameters_that_are_seen_to_be_nothing_lose_however_wrong_the_model_is(
    monkeypatch, short, gained, extra, rest, expected
):
    monkeypatch.setattr(module, "predicts_better", lambda *_, **__: True)
    leader, rival = worth(short), worth(0.0)
    leader.misfit, rival.misfit = 1000.0, 1000.0 - gained
    assert loses(leader, rival, rest, extra) is expected


def test_a_plainer_cause_does_not_lose_by_its_parameters(monkeypatch):
    asked: list[int] = []
    monkeypatch.setattr(module, "loses", lambda current, rival, rest, extra: asked.append(extra))
    layout: Any = SimpleNamespace(
        columns={
            "payload": range(12),
            "net_buoyancy": range(1),
            "tilted_vertical": range(2),
            "cg_offset": range(3),
        }
    )
    groups = [
        [explanation("net_buoyancy"), explanation("payload")],
        [explanation("payload"), explanation("net_buoyancy")],
        [explanation("tilted_vertical"), explanation("cg_offset")],
    ]
    those_that_lose(layout, groups, worth(0.0), one_by_one(lambda name, rival: worth(0.0)), 1.0)  # type: ignore[arg-type]
    assert asked == [11, 0, 0]


def test_each_rival_is_fitted_in_the_place_of_the_one_that_leads(monkeypatch):
    monkeypatch.setattr(
        module, "loses", lambda current, rival, rest, extra: current.evidence - rival.evidence > rest
    )
    names = ("ocean_current", "current_shear", "velocity_scale", "thruster_lag", "waves")
    layout: Any = SimpleNamespace(columns={n: range(1) for n in names})
    current, shear, scale = (
        explanation("ocean_current"),
        explanation("current_shear"),
        explanation("velocity_scale"),
    )
    groups = [
        [current, shear, scale],
        [explanation("payload", "thruster_lag"), explanation("payload", "waves")],
    ]
    fits = {"current_shear": -900.0, "velocity_scale": -3.0}
    asked = []

    @one_by_one
    def refit(name, rival):
        asked.append((name, rival.effects[-1]))
        return worth(fits[rival.effects[-1]]) if rival.effects[-1] in fits else None

    lost = those_that_lose(layout, groups, worth(0.0), refit, 100.0)  # type: ignore[arg-type]
    # One that cannot be fitted has not lost.
    assert lost == {("ocean_current", "current_shear")}
    assert asked == [
        ("ocean_current", "current_shear"),
        ("ocean_current", "velocity_scale"),
        ("thruster_lag", "waves"),
    ]
    steps: Any = [
        {
            "verdict": "ambiguous",
            "effects": ["ocean_current", "current_shear", "velocity_scale"],
            "p_value": 0.0,
        },
        {"verdict": "named", "effects": ["current_shear"], "p_value": 0.1},
        {"verdict": "ambiguous", "effects": ["thruster_lag", "waves"], "p_value": 0.2},
    ]
    told, kept = without_lost(steps, groups, lost)
    assert [s["effects"] for s in told] == [
        ["ocean_current", "velocity_scale"],
        ["current_shear"],
        ["thruster_lag", "waves"],
    ]
    assert [s["verdict"] for s in told] == ["ambiguous", "named", "ambiguous"]
    assert kept == [[current, scale], groups[1]]
    # A name whose rivals have all lost is given alone.
    told, kept = without_lost(steps, groups, lost | {("ocean_current", "velocity_scale")})
    assert (
        told[0] == {"verdict": "named", "effects": ["ocean_current"], "p_value": 0.0} and kept == groups[1:]
    )


def test_the_best_of_those_against_which_a_leader_loses_leads_instead(monkeypatch):
    asked: list[Any] = []

    def lose(better, worse, rest, extra):
        asked.append((better.evidence, worse.evidence, rest, extra))
        return better.evidence - worse.evidence > rest

    monkeypatch.setattr(module, "loses", lose)
    layout: Any = SimpleNamespace(
        columns={"tilted_vertical": range(2), "cg_offset": range(3), "payload": range(12), "waves": range(2)}
    )
    groups: Any = [
        [explanation("cg_offset"), explanation("tilted_vertical"), explanation("payload")],
        [explanation("cg_offset", "tether"), explanation("cg_offset", "waves")],
    ]
    fits = {"tilted_vertical": 80.0, "payload": 62.0, "waves": -3.0}

    def of(fits):
        return one_by_one(
            lambda name, rival: (
                fit(fits[rival.effects[-1]], name, rival.effects[-1])
                if rival is not None and rival.effects[-1] in fits
                else None
            )
        )

    current: Any = worth(0.0)
    name, other = that_leads_instead(layout, groups[:1], current, of(fits), 50.0)  # type: ignore[misc]
    assert name == "cg_offset" and other.evidence == 80.0
    # The plainer cause, though of more parameters, loses by the fit; a payload of twelve contains no leader of three.
    assert asked == [(80.0, 0.0, 50.0, 0), (62.0, 0.0, 50.0, 0)]
    layout.columns["tether"] = range(5)
    assert that_leads_instead(layout, groups, current, of({"waves": -3.0}), 50.0) is None
    assert asked[2:] == [(-3.0, 0.0, 50.0, 3)]
    assert that_leads_instead(layout, groups, current, of(fits), 81.0) is None
