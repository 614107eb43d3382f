"""What effects without a name would move, against fits of the whole models, and against the truth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis, fit_hypothesis
from auvnn.diagnosis.hypotheses.standard_errors import standard_errors
from auvnn.diagnosis.hypotheses.stated_priors import lay_out, priors, scales
from auvnn.diagnosis.score_tests.null_tests import NullTests
from auvnn.diagnosis.selection import moved_by_unnamed as module
from auvnn.diagnosis.selection.moved_by_unnamed import Moved, moved_by_unnamed, moved_together, widened
from auvnn.models import GreyBox
from tests.diagnosis.linear_world import GROUPS, World, layout
from tests.small_logs import make_log, small_vehicle

NAMES = ["net_buoyancy", "ocean_current", "cg_offset", "constant_force", "thruster_gain", "tether"]
# A current along the vertical axis pushes as a buoyancy does, and so does a tether that hangs above.
FORCE, DRIFT = 6.0, 0.06
# Of the linear worlds: what has a name, what has none, and all that is free without the latter.
NAMED, FURTHER = ("ocean_current",), ("net_buoyancy", "cg_offset")
BASE = [*GROUPS, *NAMED]


def world_of(**hidden: dict[str, float]) -> Any:
    model = GreyBox(small_vehicle())
    log = make_log(model.with_effects(hidden), runs=3, duration=30.0, noise=1.0)
    layout = lay_out(model, NAMES)
    windows, stated = windows_for(model, log), list(layout.nuisance)
    named = fit_hypothesis(layout, windows, stated, ["net_buoyancy"])
    base = [*stated, "net_buoyancy"]

    def of(*names: str) -> FittedHypothesis:
        return fit_hypothesis(layout, windows, stated, names)

    rest = [n for n in NAMES if n != "net_buoyancy"]
    tested = NullTests(layout, windows, lambda _: None)(named, rest, base, ["net_buoyancy"])
    at = layout.places(named.names)["net_buoyancy"]
    return SimpleNamespace(
        layout=layout, windows=windows, named=named, base=base, of=of, tested=tested, at=at
    )


@pytest.fixture(scope="module")
def two_causes() -> Any:
    return world_of(net_buoyancy={"force": FORCE}, ocean_current={"v_down": DRIFT})


def test_it_is_what_the_fit_of_the_whole_model_moves_and_leaves_open(two_causes):
    world = two_causes
    moved = moved_by_unnamed(world.windows, world.named, world.tested, world.base)
    assert moved.effects == ("ocean_current",)
    whole = world.of("ocean_current", "net_buoyancy")
    theirs = world.layout.places(whole.names)["net_buoyancy"]
    step = whole.fitted.theta[theirs] - world.named.fitted.theta[world.at]
    open_ = np.diag(whole.fitted.covariance())[theirs] - np.diag(world.named.fitted.covariance())[world.at]
    assert abs(step[0]) > 5.0 * standard_errors(world.named, world.at)[0][0]
    np.testing.assert_allclose(moved.by[world.at], np.sqrt(step**2 + open_), rtol=0.1)


def test_an_interval_that_misses_holds_the_truth_then(two_causes):
    world = two_causes
    value = world.named.fitted.theta[world.at][0]
    moved = moved_by_unnamed(world.windows, world.named, world.tested, world.base)
    before, after = (standard_errors(e, world.at)[0][0] for e in (world.named, widened(world.named, moved)))
    assert abs(value - FORCE) > 5.0 * before
    assert abs(value - FORCE) < 1.96 * after
    assert after < 2.0 * abs(value - FORCE)


def test_where_the_names_are_all_there_is_nothing_moves():
    world = world_of(net_buoyancy={"force": FORCE})
    moved = moved_by_unnamed(world.windows, world.named, world.tested, world.base)
    assert moved.effects == () and not moved.by.any()
    assert widened(world.named, moved) is world.named


def test_what_takes_up_the_same_is_put_in_once(monkeypatch):
    seen: list[list[str]] = []
    plain = module.likely_together

    def kept(*given: Any) -> list[str]:
        seen.append(given[3])
        seen.append(plain(*given))
        return seen[-1]

    monkeypatch.setattr(module, "likely_together", kept)
    world = world_of(net_buoyancy={"force": FORCE}, cg_offset={"x": 0.01})
    moved_by_unnamed(world.windows, world.named, world.tested, world.base)
    asked, joined = seen
    assert len(asked) > 1 and joined == ["cg_offset"]


def test_an_effect_with_a_shape_is_put_in_at_the_shape_that_its_test_found(monkeypatch):
    world = world_of(net_buoyancy={"force": FORCE}, tether={"stiffness": 8.0, "slack": 2.0})
    joined: list[str] = []
    plain = module.likely_together
    monkeypatch.setattr(module, "likely_together", lambda *given: joined.extend(plain(*given)) or joined)
    moved = moved_by_unnamed(world.windows, world.named, world.tested, world.base)
    assert joined[0] == "tether@0" and moved.effects[0] == "tether" and moved.by[world.at[0]] > 0.0


def test_further_effects_are_asked_for_beside_one_that_has_a_shape(monkeypatch):
    """A stand-in has its values at its null: it is no effect of the model under its own name."""
    world = world_of(
        net_buoyancy={"force": FORCE}, tether={"stiffness": 8.0, "slack": 2.0}, ocean_current={"v_north": 0.1}
    )
    joined: list[str] = []
    plain = module.likely_together
    monkeypatch.setattr(module, "likely_together", lambda *given: joined.extend(plain(*given)) or joined)
    moved = moved_by_unnamed(world.windows, world.named, world.tested, world.base)
    assert "tether@0" in joined[:-1] and len(joined) > 1
    assert set(moved.effects) >= {"tether", "ocean_current"}


def test_the_larger_of_what_is_known_to_lie_between_explanations_counts(two_causes):
    world = two_causes
    size = len(world.named.fitted.theta)
    first = widened(world.named, Moved(("waves",), np.full(size, 0.2)))
    second = widened(first, Moved(("tether",), np.linspace(0.0, 1.0, size)))
    assert second.systematic is not None and second.beside == ("tether",)
    np.testing.assert_allclose(second.systematic, np.maximum(0.2, np.linspace(0.0, 1.0, size)))


def linear(errors: Any, world: World) -> tuple[Any, Any, Any]:
    """Return the base fitted without the further effect, its sums there, and the layout."""
    theta = world.fitted_null(errors, BASE, NAMED)
    at = world.at(theta[world.layout.of(BASE)], BASE)
    return theta, world.statistics(errors, theta), at


def solved(errors: Any, world: World, names: list[str]) -> tuple[Any, Any]:
    """Return dense least squares with each prior as a further row of the equations: values and their variances."""
    columns = world.layout.of(names)
    flat = world.jacobian.reshape(-1, world.jacobian.shape[-1])[:, columns]
    known = np.concatenate(
        [
            scales(world.layout, n) ** -2.0 if n in FURTHER else priors(world.layout, [n], NAMED).precision
            for n in names
        ]
    )
    rows = np.vstack([flat, np.diag(np.sqrt(known))])
    right = np.concatenate([errors.ravel(), np.zeros(len(columns))])
    return np.linalg.lstsq(rows, right, rcond=None)[0], np.diag(np.linalg.inv(rows.T @ rows))


@pytest.fixture(scope="module")
def world() -> World:
    return World.random(layout(), strength=12.0, mixing=0.9)


@pytest.mark.parametrize("joined", [FURTHER[:1], FURTHER])
def test_it_is_the_difference_of_two_dense_least_squares(world, joined):
    random = np.random.default_rng(3)
    errors = world.errors(world.drawn(random, ocean_current=0.3, net_buoyancy=3.0, cg_offset=0.01), random)
    _, sums, at = linear(errors, world)
    moved = moved_together(at, sums, BASE, joined, NAMED)
    (alone, before), (whole, after) = (solved(errors, world, n) for n in (BASE, [*BASE, *joined]))
    size = len(alone)
    np.testing.assert_allclose(moved, np.sqrt((whole[:size] - alone) ** 2 + after[:size] - before), rtol=1e-6)
    # Both parts count.
    assert (after[:size] > 1.02 * before).any() and ((whole[:size] - alone) ** 2 > 0.1 * before).any()


def test_intervals_hold_the_truth_where_a_further_effect_is_drawn_by_its_plausible_size(world):
    random, own = np.random.default_rng(5), world.layout.places(BASE)["ocean_current"]
    inside = []
    for _ in range(150):
        size = random.normal(size=1) * scales(world.layout, "net_buoyancy")
        truth = world.drawn(random, ocean_current=0.3, net_buoyancy=size)
        theta, sums, at = linear(world.errors(truth, random), world)
        _, variance = solved(np.zeros(world.jacobian.shape[:2]), world, BASE)
        moved = moved_together(at, sums, BASE, FURTHER[:1], NAMED)
        away = np.abs(theta[world.layout.of(BASE)] - truth[world.layout.of(BASE)])[own]
        wide = np.sqrt(variance[own] + moved[own] ** 2)
        inside.append([away < 1.96 * np.sqrt(variance[own]), away < 1.96 * wide])
    alone, told = np.mean(inside, axis=(0, 2))
    assert alone < 0.9 and told > 0.93
