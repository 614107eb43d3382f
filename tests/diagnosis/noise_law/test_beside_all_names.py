"""Names compared again beside all that were found after them."""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.diagnosis.noise_law.law_fit import UNSOLVED
from auvnn.diagnosis.noise_law.rounds import path as path_module
from auvnn.diagnosis.noise_law.rounds.beside_all_names import (
    as_good_in_place,
    costs_little,
    loses,
    no_longer_needed,
    refitted,
    rivals_among,
)
from auvnn.diagnosis.noise_law.rounds.path import Path
from auvnn.diagnosis.noise_law.under_law import UnderLaw
from auvnn.diagnosis.residuals.variance_component_test import white
from auvnn.diagnosis.selection.rivals import rivals_tried
from auvnn.estimation.priors import parameters_of, set_parameters
from auvnn.executors.serial import SERIAL
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.scripted import found
from tests.diagnosis.noise_law.stand_ins import NULL, explanation, fit, one_by_one, worth
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle


def test_the_name_that_the_log_needs_least_goes():
    without = {"added_mass": 6.1, "cg_offset": 2.6, "tilted_vertical": -117.6, "payload": None}
    refit: Any = one_by_one(lambda name, rival: None if without[name] is None else worth(without[name]))
    name, rest = no_longer_needed(without, worth(0.0), refit)  # type: ignore[misc,arg-type]
    assert name == "added_mass" and rest.evidence == 6.1
    # The log is 4.6 likelier with a name that is needed, in the logarithm: a hundred to one.
    for evidence, needed in ((-4.7, True), (-4.5, False)):
        without = {"payload": evidence}
        assert (no_longer_needed(without, worth(0.0), refit) is None) is needed  # type: ignore[arg-type]
    assert no_longer_needed([], worth(0.0), refit) is None  # type: ignore[arg-type]


def test_a_name_that_brings_little_and_costs_little_goes_the_one_that_is_needed_least_first():
    """By what free running says of each, as the last one of the names."""
    current = found(0.0, "tether", "waves", "fin_lag")
    without = {"waves": -290.0, "fin_lag": -71.0, "tether": -310.0}
    asked: list[Any] = []

    def found_with(paying):
        def pays(after, before):
            asked.append((after.explanation.effects, before.evidence))
            return after.name in paying

        refit = one_by_one(lambda name, rival: worth(without[name]))
        spare = costs_little(["tether", "waves", "fin_lag"], current, refit, pays)  # type: ignore[arg-type]
        return spare and (spare[0], spare[1].evidence)

    assert found_with(()) == ("fin_lag", -71.0)
    # What brings 300 in the logarithm of the odds stands, whatever it costs.
    assert asked == [(("tether", "fin_lag", "waves"), -290.0), (("tether", "waves", "fin_lag"), -71.0)]
    assert found_with(("fin_lag",)) == ("waves", -290.0)
    assert found_with(("fin_lag", "waves")) is None
    assert costs_little([], current, one_by_one(lambda *_: None), print) is None  # type: ignore[arg-type]


@pytest.mark.parametrize("explained", [(8.0, NULL), None])
def test_a_path_goes_on_without_a_name(monkeypatch, explained):
    first, second = explanation("payload"), explanation("payload", "waves")
    path = Path(
        worth(0.0),
        ["payload", "waves", "tether"],
        [
            {"verdict": "ambiguous", "effects": ["payload", "trapped_water"], "p_value": 0.0},
            {"verdict": "ambiguous", "effects": ["waves", "gyro_bias"], "p_value": 0.0},
            {"verdict": "named", "effects": ["tether"], "p_value": 0.0},
        ],
        [[first, explanation("trapped_water")], [second, explanation("payload", "gyro_bias")]],
        [],
        [worth(1.0)],
        True,
        True,
    )
    path.without("waves", worth(7.0))
    assert path.chosen == ["payload", "tether"] and path.current.evidence == 7.0 and path.not_named == []
    assert [s["effects"] for s in path.steps] == [["payload", "trapped_water"], ["tether"]]
    assert path.groups == [[first, path.groups[0][1]]] and path.stands_out and path.explains
    # What was known of the first name goes with it, but for what the others explain without it.
    monkeypatch.setattr(
        path_module, "explains_an_axis", lambda after, before: (after.evidence, before) == explained
    )
    path.null = NULL
    path.without("payload", worth(8.0))
    assert path.chosen == ["tether"] and path.dropped == ["waves", "payload"] and path.groups == []
    assert not path.stands_out and path.explains is (explained == (8.0, NULL))


KNOWN = [
    fit(0.0, "tether"),
    # Not known to be confused with a cable.
    fit(-10.0, "gyro_bias"),
    fit(-400.0, "constant_force"),
    fit(-499.0, "net_buoyancy"),
    # Gains less than half of what the cable does.
    fit(-501.0, "ocean_current"),
]


def effects(rivals: Any) -> dict[str, list[str]]:
    return {name: [e.effects[-1] for e in of] for name, of in rivals.items()}


def test_rivals_are_confused_with_a_name_and_gained_half_as_much():
    told = effects(rivals_among(KNOWN, NULL))
    assert told["tether"] == ["constant_force", "net_buoyancy"]
    assert told["net_buoyancy"] == ["tether", "constant_force"] and told["ocean_current"][0] == "tether"
    assert rivals_among([], NULL) == {}


def test_rivals_among_fits_without_the_force_come_by_what_they_leave():
    sigma = np.arange(18.0)

    def tried(cost: float, *names: str) -> Any:
        def squared_error(by: Any) -> float:
            assert by is sigma
            return cost

        return SimpleNamespace(effects=names, squared_error=squared_error)

    fits = [
        tried(9.0),
        tried(7.0, "net_buoyancy"),
        tried(8.0, "constant_force"),
        tried(6.0, "ocean_current"),
        tried(5.0, "waves"),
        tried(4.0, "payload", "constant_force"),
        tried(1.0, "constant_force", "waves"),
    ]
    told = rivals_tried(["tether", "waves"], fits, sigma)
    assert effects(told)["tether"] == ["constant_force", "ocean_current", "net_buoyancy"]
    assert told["tether"][0] is fits[5] and "tether" not in effects(told)["waves"]


@pytest.mark.parametrize(
    ("evidences", "expected"),
    [
        ({"net_buoyancy": 30.0, "constant_force": 20.0}, ("tether", "net_buoyancy")),
        ({"net_buoyancy": 30.0, "constant_force": 40.0}, ("tether", "constant_force")),
        ({"net_buoyancy": -4.5, "constant_force": -20.0}, ("tether", "net_buoyancy")),
        ({"net_buoyancy": -4.7, "constant_force": None}, None),
    ],
)
def test_a_plainer_cause_may_take_the_place_of_a_name_once_others_are_found(evidences, expected):
    asked = []

    @one_by_one
    def refit(name: str, rival: Any) -> Any:
        asked.append((name, rival.effects[-1]))
        value = evidences[rival.effects[-1]]
        return None if value is None else fit(value, "tilted_vertical", rival.effects[-1])

    current, rivals = fit(0.0, "tether", "tilted_vertical"), rivals_among(KNOWN, NULL)
    found = as_good_in_place(["tether"], current, rivals, refit)
    assert (None if found is None else (found[0], found[1].name)) == expected
    assert asked == [("tether", "constant_force"), ("tether", "net_buoyancy")]
    # Two are fitted, of those that are not named.
    more = {
        "tether": [explanation(n) for n in ("tilted_vertical", "constant_force", "net_buoyancy", "waves")]
    }
    as_good_in_place(["tether"], current, more, refit)
    assert asked[2:] == asked[:2]
    # A name that was found later has no rivals from the first round; one that is named has its own place.
    assert as_good_in_place(["tilted_vertical"], current, rivals, refit) is None
    named = fit(0.0, "tether", "net_buoyancy", "constant_force")
    assert as_good_in_place(["tether"], named, rivals, refit) is None and len(asked) == 4


@dataclass(frozen=True)
class Explained:
    """What an explanation supposes."""

    effects: tuple[str, ...]


@pytest.mark.parametrize("tied", [True, False])
def test_a_rival_takes_the_place_of_a_name_on_the_path(tied):
    current: Any = SimpleNamespace(evidence=0.0, explanation=Explained(("tether", "tilted_vertical")))
    steps: Any = [
        {"verdict": "ambiguous", "effects": ["tether", "waves"], "p_value": 1e-9},
        {"verdict": "named", "effects": ["tilted_vertical"], "p_value": 1e-5},
    ]
    waves = explanation("waves")
    path = Path(
        current, ["tether", "tilted_vertical"], steps, [[explanation("tether"), waves]], stands_out=True
    )
    other: Any = fit(3.0, "tilted_vertical", "net_buoyancy")
    path.exchange("tether", other, tied=tied)
    assert path.chosen == ["net_buoyancy", "tilted_vertical"] and path.current is other
    assert path.dropped == ["tether"] and path.steps[1] == steps[1]
    # What could not be told from the name is not refuted by that.
    group = ["net_buoyancy", "tether", "waves"] if tied else ["net_buoyancy", "waves"]
    assert path.steps[0] == {"verdict": "ambiguous", "effects": group, "p_value": 1e-9}
    assert [[e.effects[-1] for e in g] for g in path.groups] == [group]
    assert path.groups[0][0].effects == ("tilted_vertical", "net_buoyancy") and path.groups[0][-1] is waves
    if tied:
        assert path.groups[0][1].effects == ("tilted_vertical", "tether")
    # One of its group does not come twice.
    step: Any = {"verdict": "ambiguous", "effects": ["tether", "waves"], "p_value": 1e-9}
    grouped = Path(current, ["tether"], [step], [[explanation("tether"), waves]])
    grouped.exchange("tether", fit(3.0, "waves"), tied=tied)
    assert grouped.steps[0]["effects"] == (["waves", "tether"] if tied else ["waves"])
    # A name without a group is exchanged for one without.
    path.current = current
    path.exchange("tilted_vertical", fit(4.0, "net_buoyancy", "cg_offset"), tied=False)
    assert path.steps[1] == {"verdict": "named", "effects": ["cg_offset"], "p_value": 1e-5}
    assert (
        len(path.groups) == 1
        and path.members("cg_offset") == 1
        and path.members("net_buoyancy") == len(group)
    )


def test_a_rival_that_does_as_well_is_told_together_with_the_name():
    current: Any = SimpleNamespace(evidence=0.0, explanation=Explained(("tether", "tilted_vertical")))
    steps: Any = [
        {"verdict": "named", "effects": ["tether"], "p_value": 1e-9},
        {"verdict": "named", "effects": ["tilted_vertical"], "p_value": 1e-5},
    ]
    path = Path(current, ["tether", "tilted_vertical"], list(steps))
    path.tie("tether", fit(-3.0, "tilted_vertical", "net_buoyancy"))
    assert path.steps[0]["verdict"] == "ambiguous" and path.steps[0]["effects"] == ["tether", "net_buoyancy"]
    assert [e.effects for e in path.groups[0]] == [
        ("tilted_vertical", "tether"),
        ("tilted_vertical", "net_buoyancy"),
    ]
    path.tie("tether", fit(-3.0, "tilted_vertical", "constant_force"))
    assert path.steps[0]["effects"] == ["tether", "net_buoyancy", "constant_force"] and len(path.groups) == 1
    assert (
        path.chosen == ["tether", "tilted_vertical"] and path.current is current and path.steps[1] == steps[1]
    )


@pytest.fixture(scope="module")
def beside() -> tuple[UnderLaw, Any]:
    """A log with a net buoyancy and a force of no cause, and what is known of it without any name."""
    model = GreyBox(small_vehicle())
    rms = np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5])
    plant = model.with_effects({"net_buoyancy": {"force": 8.0}})
    log = wandering_log(plant, rms, 1.0, runs=2, duration=40.0, seed=1)
    layout, windows = lay_out(model, ["net_buoyancy", "thruster_gain", "gyro_bias"]), windows_for(model, log)
    base = ["linear_damping", "quadratic_damping"]
    asked: Any = SimpleNamespace(layout=layout, base=base, say=lambda _: None, log=log, pool=SERIAL)
    first = fit_hypothesis(layout, windows, base, (), iterations=4)
    under = UnderLaw(asked, windows)
    null = under.begin(first, white(first, np.full(18, 1e-9)))
    assert null is not None
    return under, null


def named(beside: tuple[UnderLaw, Any], *effects: str) -> Any:
    under, null = beside
    model = null.explanation.fitted.model
    return under.fits().from_null(under.layout, model, null, under.base, list(effects))


def test_a_name_that_took_up_what_a_later_one_explains_is_needed_no_longer(beside):
    """Against a fit that never had the name: the two have to end at the same place."""
    under, _ = beside
    both, right = named(beside, "thruster_gain", "net_buoyancy"), named(beside, "net_buoyancy")
    without = refitted(under.layout, under.fits(), both, under.base, "thruster_gain", None)
    assert without is not None and without.explanation.effects == ("net_buoyancy",)
    assert without.evidence == pytest.approx(right.evidence, abs=1.0)
    value = float(parameters_of(without.explanation.fitted.model, ["net_buoyancy"])[0])
    assert value == pytest.approx(8.0, abs=3.0)
    assert parameters_of(without.explanation.fitted.model, ["thruster_gain"]) == pytest.approx(1.0)

    @one_by_one
    def refit(name: str, rival: Any) -> Any:
        return refitted(under.layout, under.fits(), both, under.base, name, rival)

    found = no_longer_needed(both.explanation.effects, both, refit)
    assert found is not None and found[0] == "thruster_gain"
    assert no_longer_needed(["net_buoyancy"], both, refit) is None


def test_a_rival_takes_the_place_of_a_name_with_what_it_was_fitted_to(beside, monkeypatch):
    under, _ = beside
    right, wrong = named(beside, "net_buoyancy"), named(beside, "gyro_bias")
    found = refitted(under.layout, under.fits(), right, under.base, "net_buoyancy", wrong.explanation)
    assert found is not None and found.explanation.effects == ("gyro_bias",)
    assert found.evidence == pytest.approx(wrong.evidence, abs=1.0)
    short = right.evidence - found.evidence
    assert loses(right, found, 0.0, 0) and not loses(right, found, short + 1.0, 0)
    # It begins with its own values, and the name it takes the place of is as it was stated.
    began: list[Any] = []
    model = wrong.explanation.fitted.model
    set_parameters(model, ["gyro_bias"], np.array([0.011, 0.012, 0.013]))
    fits = under.fits()
    monkeypatch.setattr(
        fits, "from_null", lambda layout, model, *given, held: began.append((model, *given, held))
    )
    assert refitted(under.layout, fits, right, under.base, "net_buoyancy", wrong.explanation) is None
    assert parameters_of(began[0][0], ["gyro_bias"]) == pytest.approx([0.011, 0.012, 0.013])
    assert parameters_of(began[0][0], ["net_buoyancy"]) == pytest.approx(0.0)
    # What falls far short is given up, under the law that is likeliest there; one that is compared goes on to its end.
    assert refitted(under.layout, fits, right, under.base, "net_buoyancy", None, whole=True) is None
    assert [given[-2:] for given in began] == [(right.evidence - 1000.0, False), (-np.inf, False)]
    assert all(given[1] is right and given[2] == under.base for given in began)
    assert [given[3] for given in began] == [["gyro_bias"], []]

    def failing(*_: Any, **__: Any) -> Any:
        raise UNSOLVED[1]("SVD did not converge")

    monkeypatch.setattr(fits, "from_null", failing)
    assert refitted(under.layout, fits, right, under.base, "net_buoyancy", None) is None


def test_a_path_to_names_of_another_search():
    named: Any = SimpleNamespace(
        evidence=0.0, explanation=Explained(("added_mass", "tilted_vertical", "cg_offset"))
    )
    steps: Any = [
        {"verdict": "named", "effects": ["payload"], "p_value": 0.01},
        {"verdict": "named", "effects": ["added_mass"], "p_value": 0.02},
        # A step that withdraws one says nothing of it.
        {"verdict": "withdrawn", "effects": ["payload", "added_mass"], "p_value": 0.03},
        {"verdict": "ambiguous", "effects": ["tilted_vertical", "cg_offset"], "p_value": 0.04},
        {"verdict": "unknown", "effects": [], "p_value": 0.05},
    ]
    path = Path.of_names(named, steps)
    assert path.chosen == ["added_mass", "tilted_vertical", "cg_offset"] and path.current is named
    assert [(s["verdict"], s["effects"], s["p_value"]) for s in path.steps] == [
        ("named", ["added_mass"], 0.02),
        ("named", ["tilted_vertical"], 0.04),
        ("named", ["cg_offset"], 0.04),
    ]
    assert path.groups == [] and not path.stands_out
