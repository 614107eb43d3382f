"""Names together with a stochastic force, on small logs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.noise_law.hypothesis import explains_an_axis, predicts_better, shares_left, tied
from auvnn.diagnosis.noise_law.rounds import free_running_cost as free_running_cost_module
from auvnn.diagnosis.noise_law.rounds import names_given
from auvnn.diagnosis.noise_law.rounds.a_round import Round
from auvnn.diagnosis.noise_law.rounds.free_running_cost import Cost, free_running_cost
from auvnn.diagnosis.noise_law.rounds.names_given import NamesGiven
from auvnn.metrics.force_law import ForceLaw
from auvnn.metrics.rollouts import roll, scale_of
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


def left_as_its_law(found):
    """Assert that what is left is the law's, and that this is what acts."""
    assert {"X", "Y", "Z", "cost"} <= found.left.keys()
    for axis, told in found.left.items():
        law = found.stochastic["force"].get(axis)
        if axis != "cost" and law is None:
            assert told["rms"] == 0.0 and told["correlation_time"] is None and told["detectable"] > 0.0
        elif axis != "cost":
            assert {n: told[n] for n in law} == law and told["upper"] > told["rms"]
            assert told["rms"] == pytest.approx(RMS["XYZKMN".index(axis)], rel=0.3)


@pytest.mark.long
def test_an_effect_is_named_and_the_force_beside_it_told():
    found = said({"net_buoyancy": {"force": 8.0}})
    assert found.verdict == "named" and found.missing == ["net_buoyancy"]
    assert {"X", "Y", "Z"} <= found.stochastic["force"].keys()
    for axis in "XYZ":
        assert found.stochastic["force"][axis]["rms"] == pytest.approx(4.0, rel=0.3)
        assert 0.4 < found.stochastic["force"][axis]["correlation_time"] < 2.5
    assert any("stochastic force" in line for line in found.story)
    left_as_its_law(found)
    parameters = found.candidates[0]["parameters"]["force"]
    assert parameters["value"] == pytest.approx(8.0, abs=4 * parameters["std"])


@pytest.mark.long
def test_a_force_alone_has_no_name():
    found = said({}, seed=2)
    assert found.missing == [] and found.verdict == "unknown" and found.stochastic["force"]
    left_as_its_law(found)


@pytest.mark.long
def test_without_a_force_the_answer_is_the_plain_search():
    found = said({"net_buoyancy": {"force": 8.0}}, rms=np.zeros(6))
    assert found.missing == ["net_buoyancy"] and "force" not in found.stochastic


def hypothesis(name, misfit, evidence=None) -> Any:
    """Return as much of a hypothesis as a comparison looks at."""
    return SimpleNamespace(
        name=name,
        misfit=misfit,
        evidence=-0.5 * misfit if evidence is None else evidence,
        explanation=SimpleNamespace(effects=(name,) if name else ()),
    )


COLUMNS: Any = SimpleNamespace(
    columns={
        "added_mass": range(6),
        "trapped_water": range(1),
        "net_buoyancy": range(1),
        "thruster_lag": range(8),
        "tether": range(10),
        "quadratic_damping": range(6),
        "fin_drag": range(2),
    }
)


def names_of(good, before=10000.0):
    return [h.name for h in tied(COLUMNS, good, hypothesis("", before))]


def test_a_further_name_must_be_sure_in_the_mean_where_the_noise_is_white(monkeypatch):
    """A first name, and one beside noise that is not white, may also predict most windows better."""
    asked_for: list[tuple[float, bool]] = []

    def better(after, before, least, *, ranks):
        asked_for.append((least, ranks))
        return True

    monkeypatch.setattr(names_given, "predicts_better", better)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    for chosen, white in (([], True), (["tether"], True), (["tether"], False)):
        asked = given(tolerance=Tolerance.of(0), white_noise=white)
        at = Round(None, with_law((2.0, 2.0)), [], chosen)  # type: ignore[arg-type]
        asked.likely(at, 10, [with_law((0.1, 0.1), 50.0, "waves")], 4.0)  # type: ignore[list-item]
    further = names_given.GAIN_FURTHER
    assert asked_for == [(names_given.GAIN, True), (further, False), (further, True)] and further == 3.0


@pytest.mark.parametrize(
    ("error", "typical", "expected"),
    [
        (-0.6, -0.13, True),
        (-0.06, -0.06, True),
        (-0.6, -0.04, False),
        (-0.04, -0.6, False),
        (0.2, 0.3, False),
    ],
)
def test_names_worsen_free_running_where_they_do_in_all_windows_and_in_the_median_one(
    monkeypatch, error, typical, expected
):
    ran: list[Any] = []

    def cost(after, before, log, scale):
        ran.append((after, before))
        return Cost(error, typical, 0.0, 0.0, False)

    monkeypatch.setattr(names_given, "free_running_cost", cost)

    def of(*effects: str) -> Any:
        model = SimpleNamespace(without_absent=lambda names: ("lean", *names))
        return SimpleNamespace(
            explanation=SimpleNamespace(effects=effects, fitted=SimpleNamespace(model=model))
        )

    assert given(tolerance=Tolerance.of(None)).worsen(of("waves", "tether"), of()) is expected
    assert ran == [(("lean", "waves", "tether"), ("lean",))]
    # Where everything matters that is there, evidence alone counts.
    assert not given(tolerance=Tolerance.of(0)).worsen(of("waves"), of()) and len(ran) == 1


def test_what_is_likelier_and_known_to_be_confused_comes_first_though_it_predicts_less_surely(monkeypatch):
    sure = {"munk_moment", "tether"}
    monkeypatch.setattr(names_given, "predicts_better", lambda after, *_, **__: after.name in sure)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    at = Round(None, with_law((2.0, 2.0)), [], ["drag_curve"])  # type: ignore[arg-type]

    def said(*names):
        found: Any = [with_law((1.0, 1.0), 90.0 - k, name) for k, name in enumerate(names)]
        return [h.name for h in given().likely(at, 10, found, 4.0)]

    # What is not known to be confused with it, or is less likely, does not count.
    assert said("payload", "body_lift", "munk_moment", "tether") == ["body_lift", "munk_moment", "tether"]
    assert said("munk_moment", "body_lift") == ["munk_moment"]
    assert said("payload", "body_lift") == []


def test_what_is_likelier_and_known_to_be_confused_comes_first_though_more_is_asked_of_it(monkeypatch):
    """Odds of a hundred are enough where a name takes most of a force; what gains more than that needs no more either."""
    monkeypatch.setattr(names_given, "predicts_better", lambda *_, **__: True)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    at = Round(None, with_law((2.0, 2.0)), [], ["cg_offset"])  # type: ignore[arg-type]

    def said(*names):
        # Of these the body lift alone takes most of a force.
        found: Any = [
            with_law((0.1, 0.1) if name == "body_lift" else (1.9, 1.9), 90.0 - k, name)
            for k, name in enumerate(names)
        ]
        return [h.name for h in given().likely(at, 10, found, 200.0)]

    assert said("tether", "munk_moment", "body_lift", "turning_forces") == ["munk_moment", "body_lift"]
    assert said("munk_moment", "tether") == []


def test_what_is_known_to_be_confused_and_explains_nearly_as_much_is_tied():
    best, other = hypothesis("added_mass", 5000.0), hypothesis("trapped_water", 5200.0)
    # One mass is plainer than six factors.
    assert names_of([best, other]) == ["trapped_water", "added_mass"]
    # Beyond a tenth of the gain it is refuted; and what is not known to be confused is refuted much earlier.
    assert names_of([best, hypothesis("trapped_water", 5600.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5200.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5000.5)]) == ["added_mass", "net_buoyancy"]


def test_drag_is_plainer_than_a_cable_that_is_dragged_along():
    best = hypothesis("tether", 5000.0)
    assert names_of([best, hypothesis("fin_drag", 5200.0)]) == ["tether", "fin_drag"]
    assert names_of([best, hypothesis("fin_drag", 5200.0), hypothesis("quadratic_damping", 5300.0)]) == [
        "quadratic_damping",
        "tether",
        "fin_drag",
    ]
    assert names_of([best, hypothesis("net_buoyancy", 5200.0)]) == ["net_buoyancy", "tether"]


def test_what_is_as_likely_and_known_to_be_confused_is_tied_however_much_more_parameters_fit():
    best = hypothesis("added_mass", 5000.0, -2600.0)
    # Worse by more than a tenth of the gain, and as likely for its fewer parameters.
    assert names_of([best, hypothesis("trapped_water", 5600.0, -2604.0)]) == ["trapped_water", "added_mass"]
    assert names_of([best, hypothesis("trapped_water", 5600.0, -2605.0)]) == ["added_mass"]
    assert names_of([best, hypothesis("net_buoyancy", 5600.0, -2604.0)]) == ["added_mass"]


def test_the_nearly_as_good_do_not_make_a_group_too_large():
    good = [hypothesis("added_mass", 5000.0), hypothesis("net_buoyancy", 5000.5)]
    assert names_of([*good, hypothesis("trapped_water", 5100.0), hypothesis("thruster_lag", 5150.0)]) == [
        "trapped_water",
        "added_mass",
        "net_buoyancy",
    ]


THRUST: Any = SimpleNamespace(
    columns={
        n: range(1) for n in ("thruster_gain", "thrust_asymmetry", "thrust_inflow_loss", "voltage_droop")
    }
)


def test_of_more_that_are_alike_than_a_group_holds_the_plainest_of_all_and_the_best_are_told():
    good = [hypothesis(n, 5000.0 + 0.1 * k) for k, n in enumerate(THRUST.columns)]

    def said(order):
        return [h.name for h in tied(THRUST, [good[k] for k in order], hypothesis("", 10000.0))]

    # A gain of the thrust is plainer than each of the others.
    assert said([0, 1, 2, 3]) == ["thruster_gain", "thrust_asymmetry", "thrust_inflow_loss"]
    good[0], good[3] = hypothesis("thruster_gain", 5000.3), hypothesis("voltage_droop", 5000.0)
    assert said([3, 1, 2, 0]) == ["thruster_gain", "voltage_droop", "thrust_asymmetry"]
    # Of the others none is: a group that is too large is returned whole, and none of it is given.
    columns: Any = SimpleNamespace(columns={**THRUST.columns, "munk_moment": range(1)})
    others = [*good[1:], hypothesis("munk_moment", 5000.2)]
    assert len(tied(columns, others, hypothesis("", 10000.0))) == 4


def given(**changes: Any) -> NamesGiven:
    """Return what decides which of the likely explanations cost enough."""
    at: dict[str, Any] = {"layout": None, "log": None, "scale": None, "tolerance": Tolerance(), **changes}
    return NamesGiven(**at)


def paying(costs, monkeypatch, without=1e3, **changes):
    """Return which of some explanations, each ten in evidence after the one before it, are taken at these costs.

    The first is ahead of the explanation without any by 450.
    """
    likely = [hypothesis(name, 100.0 + 20.0 * k) for k, name in enumerate(costs)]

    def cost_of(_, h, *__, **___):
        """Return what is given: error and moves, then whether it is surely worse (yes), and in the median window."""
        error, moves, *more = costs[h.name]
        return Cost(error, *(more[1:] or [error]), moves, 0.0, bool(more[0]) if more else True)  # type: ignore[arg-type]

    monkeypatch.setattr(names_given, "cost_of_name", cost_of)
    return [h.name for h in given(**changes).paying(likely, hypothesis("", without), 0.5)]


def test_a_name_must_cost_enough_by_the_errors(monkeypatch):
    assert paying({"tether": (0.2, 0.0), "waves": (0.01, 0.3)}, monkeypatch) == ["tether"]
    # One that costs little and is likelier comes before one that costs enough; by itself it is not given.
    assert paying({"waves": (0.01, 0.01), "tether": (0.2, 0.0)}, monkeypatch) == ["waves", "tether"]
    assert paying({"waves": (0.01, 0.3)}, monkeypatch) == []
    assert paying({"waves": (0.01, 0.3)}, monkeypatch, ignores_cost=True) == ["waves"]
    assert paying({"waves": (-0.2, 0.3)}, monkeypatch, ignores_cost=True) == []
    assert paying({"waves": (-0.2, 0.3)}, monkeypatch, tolerance=Tolerance.of(0)) == ["waves"]


def test_what_is_beyond_doubt_is_named_whatever_it_costs(monkeypatch):
    """The first has a misfit of 100 and the second one of 120: twice the log odds are what they are below `without`."""
    one, both = {"waves": (-0.2, 0.0)}, {"waves": (-0.2, 0.0), "tether": (0.01, 0.0)}
    enough = 100.0 + 2.0 * names_given.DECISIVE
    assert paying(one, monkeypatch, without=enough + 1.0) == ["waves"]
    assert paying(one, monkeypatch, without=enough - 1.0) == []
    assert paying(both, monkeypatch, without=enough + 19.0) == ["waves"]
    assert paying(both, monkeypatch, without=enough + 21.0) == ["waves", "tether"]


def with_law(rms, evidence=0.0, name="", time=1.0) -> Any:
    law = ForceLaw(np.array([*rms, 0.0, 0.0, 0.0, 0.0]), np.full(6, time), 0.5, 5.0)
    return SimpleNamespace(
        name=name, evidence=evidence, misfit=-2.0 * evidence, estimate=SimpleNamespace(law=law)
    )


def test_a_force_left_is_that_of_the_mean_over_a_second():
    before, after = with_law((2.0, 4.0)), with_law((1.0, 4.0), time=0.125)
    # The mean over a second of what lasts an eighth: half of the rms.
    np.testing.assert_allclose(shares_left(after.estimate.law, before.estimate.law), [0.25 / 4.0, 0.25])
    np.testing.assert_allclose(shares_left(None, before.estimate.law), [0.0, 0.0])
    assert explains_an_axis(after, before) and not explains_an_axis(before, before)  # type: ignore[arg-type]


@pytest.mark.parametrize(("rms", "expected"), [((0.3, 2.0), ["waves"]), ((0.7, 2.0), [])])
def test_a_further_name_brings_much_of_the_gain_or_takes_the_force_of_an_axis(rms, expected, monkeypatch):
    monkeypatch.setattr(names_given, "predicts_better", lambda *_, **__: True)
    monkeypatch.setattr(names_given, "p_value_of", lambda *_: 1e-12)
    asked = given(tolerance=Tolerance.of(0))
    at = Round(None, with_law((2.0, 2.0)), [], ["tether"])  # type: ignore[arg-type]
    found = with_law(rms, 50.0, "waves")
    assert [h.name for h in asked.good(at, 10, [found], 100.0)] == expected  # type: ignore[list-item]
    # Or most of it where the names before it took less: here they took nothing of X, or all but a little.
    for before, more in (((2.0, 2.0), ["waves"]), ((20.0, 2.0), expected)):
        after = Round(None, at.current, [], ["tether"], null=with_law(before))  # type: ignore[arg-type]
        assert [h.name for h in asked.good(after, 10, [found], 100.0)] == more  # type: ignore[list-item]
        first = Round(None, at.current, [], [], null=with_law(before))  # type: ignore[arg-type]
        assert [h.name for h in asked.good(first, 10, [found], 100.0)] == expected  # type: ignore[list-item]
    # As much evidence as was asked for is enough by itself.
    assert asked.good(at, 10, [found], 40.0) == [found]  # type: ignore[list-item]


def test_in_open_loop_free_running_must_not_get_worse(monkeypatch):
    # One that is less likely does not stand in the way of another one.
    assert paying({"tether": (0.2, 0.2), "waves": (-0.2, 0.3)}, monkeypatch) == ["tether"]
    assert paying({"waves": (-0.01, 0.3), "tether": (0.2, 0.2)}, monkeypatch) == []
    assert paying({"waves": (-0.2, 0.01), "tether": (0.2, 0.2)}, monkeypatch) == []
    # Where predictions hardly move, half of a tenth being enough, neither stands against the other.
    assert paying({"waves": (-0.01, 0.03), "tether": (0.2, 0.2)}, monkeypatch) == ["tether"]


def test_where_sensors_are_not_white_a_few_windows_do_not_decide_what_a_name_costs(monkeypatch):
    """They may put windows on a wrong start: the median window says that a name costs enough, and chance is no word."""
    costly, by_chance = (-0.2, 0.3, True, 0.06), (-0.2, 0.3, False)
    for white, costs, expected in (
        (False, {"waves": costly}, ["waves"]),
        # White: where the mean is surely worse it counts, and otherwise the median window may say so too.
        (True, {"waves": costly}, []),
        (True, {"waves": (-0.2, 0.3, False, 0.06)}, ["waves"]),
        (True, {"waves": (-0.2, 0.3, False, 0.04)}, []),
        (False, {"waves": (-0.2, 0.3, True, 0.04)}, []),
        (False, {"waves": by_chance, "tether": (0.2, 0.2)}, ["tether"]),
        (False, {"waves": (-0.2, 0.3, True), "tether": (0.2, 0.2)}, []),
        (True, {"waves": by_chance, "tether": (0.2, 0.2)}, []),
    ):
        assert paying(costs, monkeypatch, white_noise=white) == expected


def test_in_closed_loop_it_is_enough_that_predictions_move(monkeypatch):
    costs = {"waves": (-0.2, 0.2), "tether": (-0.2, 0.01), "payload": (0.2, 0.0)}
    assert paying(costs, monkeypatch, in_closed_loop=True) == ["waves", "payload"]
    assert paying({"waves": (0.0, 0.01)}, monkeypatch, in_closed_loop=True) == []


def test_what_is_known_to_be_confused_with_a_name_is_compared_with_it_whatever_it_costs(monkeypatch):
    cheap, dear = (-0.2, 0.01), (0.2, 0.2)
    assert paying({"tether": dear, "biofouling": cheap}, monkeypatch) == ["tether", "biofouling"]
    assert paying({"tether": dear, "waves": cheap}, monkeypatch) == ["tether"]


def test_the_cost_is_that_of_errors_and_of_predictions_that_move():
    """Against errors and changes summed here, sample by sample."""
    model = GreyBox(small_vehicle())
    truth = model.with_effects({"net_buoyancy": {"force": 8.0}})
    log = wandering_log(truth, 0.2 * RMS, TIME, runs=2, duration=20.0)
    scale = scale_of(log)

    before, after = (model.with_effects({"net_buoyancy": {"force": force}}) for force in (0.0, 8.0))
    found = free_running_cost(after, before, log, scale)
    cost, size = found.error, found.moves
    predicted = []
    for force in (0.0, 8.0):
        rolled = roll(model.with_effects({"net_buoyancy": {"force": force}}), log, "5", scale)
        assert rolled is not None
        predicted.append(rolled.predicted[:, 1:])
    measured, mask = rolled.windows.nu.numpy()[:, 1:], rolled.windows.mask[:, 1:, 6:12].numpy() > 0

    def size_of(gap):
        rms = np.array([np.sqrt((gap[..., i][mask[..., i]] ** 2).mean()) for i in range(6)]) / scale.std
        return rms[scale.excited].mean()

    errors = [size_of(p - measured) for p in predicted]
    assert cost == pytest.approx(errors[0] / errors[1] - 1.0, rel=1e-6) and cost > 0.1
    away = size_of(predicted[1] - predicted[0]) / errors[1]
    assert size == pytest.approx(np.sqrt(1.0 + away**2) - 1.0, rel=1e-6)
    # The force does not know of the commands here: both figures say much the same.
    assert size == pytest.approx(cost, rel=0.5)
    assert free_running_cost(after, after, log, scale) == Cost(0.0, 0.0, 0.0, 0.0, worse=False)
    # In the median window: of each window's mean square in units of the velocities' variance.
    squares = [
        (((p - measured) ** 2 * mask).sum(1) / mask.sum(1) / scale.std**2)[:, scale.excited]
        for p in predicted
    ]
    middle = [np.sqrt(np.median(s, axis=0)).mean() for s in squares]
    assert found.typical == pytest.approx(middle[0] / middle[1] - 1.0, rel=1e-6) and found.least >= cost
    # The other way round errors are larger in nearly all windows.
    assert not found.worse and free_running_cost(before, after, log, scale).worse


def test_a_window_without_a_sample_of_a_velocity_is_none_of_the_median():
    """Two of three windows have no sample of v: the third is the median one."""
    squared, count = (
        np.array([[4.0, 0.0], [9.0, 0.0], [16.0, 50.0]]),
        np.array([[1.0, 0.0], [1.0, 0.0], [1.0, 2.0]]),
    )
    rolled: Any = SimpleNamespace(squared=squared, count=count)
    scale: Any = SimpleNamespace(std=np.ones(2), excited=np.ones(2, dtype=bool))
    assert free_running_cost_module._median(scale, rolled) == pytest.approx((3.0 + 5.0) / 2.0)
    by_window = free_running_cost_module._by_window(scale, rolled)
    assert free_running_cost_module._surely_less(by_window, by_window + 5.0)


def test_runs_left_out_are_predicted_better_in_the_mean_or_in_most_windows(monkeypatch):
    random = np.random.default_rng(0)

    def better(gain, least=1.0, **how):
        monkeypatch.setattr("auvnn.diagnosis.noise_law.hypothesis.gain_by_window", lambda *_: gain)
        nothing = SimpleNamespace(weighed=None)
        return predicts_better(nothing, nothing, least, **how)  # type: ignore[arg-type]

    # An effect in few windows, and one in most of them whose mean three windows decide in which sensors are wrong.
    few = np.concatenate([0.1 * random.normal(size=90), 30.0 + random.normal(size=10)])
    most = np.concatenate([20.0 + 15.0 * random.normal(size=90), [-1700.0, -1500.0, -700.0]])
    assert better(few) and better(few, 2.0) and better(most) and better(most, 2.0)
    assert most.sum() < np.sqrt(len(most)) * most.std(ddof=1)
    assert better(few, ranks=False) and not better(most, ranks=False)
    # A few that gain very much hide no more what the others gain.
    large = np.concatenate([20.0 + 15.0 * random.normal(size=90), [90000.0, 5000.0, 3000.0]])
    assert large.sum() < 3.0 * np.sqrt(len(large)) * large.std(ddof=1) and better(large, 3.0, ranks=False)
    # Of what explains nothing one in a thousand does by its ranks.
    worse = [better(random.normal(size=100) - 0.1, 3.0) for _ in range(200)]
    assert sum(worse) <= 2
    assert not better(np.zeros(50)) and not better(np.full(50, np.nan))
