"""With which name a search begins where several explain about as much."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law.rounds.looking_ahead import Branch, decided, shared, worth_following
from tests.diagnosis.noise_law.scripted import (
    NULL,
    found,
    names,
    search,
)


def branch(first: Any, *further: tuple[float, str]) -> Branch:
    pairs = [found(first.evidence + gain, first.name, name) for gain, name in further]
    return Branch(first, first, pairs)


def test_a_third_effect_that_explains_a_part_of_both_does_not_come_first():
    payload, uneven, gain = (
        found(10.0, "payload"),
        found(8.0, "thrust_asymmetry"),
        found(0.0, "thruster_gain"),
    )
    good = [payload, uneven, gain]
    branches = [
        branch(payload, (370.0, "thrust_asymmetry"), (70.0, "constant_force")),
        branch(uneven, (371.0, "trapped_water"), (200.0, "thruster_gain")),
        branch(gain, (210.0, "thrust_asymmetry")),
    ]
    # Both of the likeliest pairs have the asymmetry in them.
    assert names(decided(good, branches, NULL)) == ["thrust_asymmetry"]
    # From there the other pair is a further name as good as the one that was found there.
    moved = [(b.first.name, h.name, h.explanation.effects) for b, h in shared(branches)]
    assert ("thrust_asymmetry", "payload", ("thrust_asymmetry", "payload")) in moved
    assert ("thruster_gain", "thrust_asymmetry", ("thruster_gain", "thrust_asymmetry")) in moved
    assert len(moved) == 3


@pytest.mark.parametrize("seed", range(20))
def test_the_best_of_all_pairs_is_begun_with_where_it_stands_alone(seed):
    """Against all pairs of a linear regression, summed here; forward selection alone misses some of them."""
    random = np.random.default_rng(seed)
    columns = {n: random.normal(size=600) for n in ("tether", "waves", "payload")}
    truth = columns["tether"] + columns["waves"]
    columns["payload"] = truth + random.normal(0.0, 0.9, size=600)
    measured = 4.0 * truth + random.normal(size=600)

    def evidence(*chosen: str) -> float:
        design = np.stack([columns[n] for n in chosen], 1) if chosen else np.zeros((600, 1))
        left = measured - design @ np.linalg.lstsq(design, measured, rcond=None)[0]
        return -0.5 * float(left @ left) - 2.0 * len(chosen)

    null = found(evidence())
    good = sorted([found(evidence(n), n) for n in columns], key=lambda h: -h.evidence)
    branches = [
        Branch(h, h, [found(evidence(h.name, n), h.name, n) for n in columns if n != h.name]) for h in good
    ]
    best = max(combinations(columns, 2), key=lambda pair: evidence(*pair))
    assert {*best} == {"tether", "waves"}
    assert good[0].name == "payload"
    first = decided(good, branches, null)[0]
    assert first.name in best


def test_names_that_nothing_tells_apart_stay_together():
    good = [found(10.0, "drag_curve"), found(9.0, "linear_damping"), found(-500.0, "waves")]
    branches = [branch(good[0], (100.0, "tether")), branch(good[1], (100.0, "tether"))]
    assert names(decided(good, branches, NULL)) == ["drag_curve", "linear_damping", "waves"]
    # Followed by what explains more, one of them is ahead.
    branches = [branch(good[0], (100.0, "tether")), branch(good[1], (300.0, "tether"))]
    assert names(decided(good, branches, NULL))[0] == "linear_damping"
    # The one that it is confused with was followed, and is out; another that was not followed stays.
    assert names(decided(good, branches, NULL)) == ["linear_damping"]
    assert names(decided([*good, found(-600.0, "drag_curve")], branches[1:], NULL)) == [
        "linear_damping",
        "drag_curve",
        "drag_curve",
    ]


def test_a_rival_that_leads_nowhere_is_dropped():
    good = [found(10.0, "tether"), found(0.0, "waves"), found(-400.0, "payload")]
    branches = [branch(good[0], (200.0, "cg_offset")), branch(good[1])]
    assert names(decided(good, branches, NULL)) == ["tether"]
    # Of three, the one that is in no pair as likely as the best is dropped.
    branches = [
        branch(good[0], (60.0, "flooding")),
        branch(good[1], (60.0, "gyro_bias")),
        branch(good[2], (9.0, "payload")),
    ]
    assert names(decided(good, branches, NULL)) == ["tether", "waves"]
    # By less than the law may be wrong by, a tenth of what is explained, nothing is dropped.
    branches = [branch(good[0], (60.0, "cg_offset")), branch(good[1], (30.0, "payload"))]
    assert names(decided(good, branches, NULL)) == ["tether", "waves", "payload"]


def test_those_are_followed_that_explain_half_as_much_and_three_of_them_at_most():
    good = [found(e, n) for e, n in ((0.0, "a"), (-400.0, "b"), (-499.0, "c"), (-501.0, "d"))]
    assert names(worth_following(good, NULL)) == ["a", "b", "c"]
    assert names(worth_following(good[:1], NULL)) == ["a"]
    assert names(worth_following([good[0], good[3]], NULL)) == ["a"]
    assert len(worth_following([found(-float(k), str(k)) for k in range(5)], NULL)) == 3


def test_where_the_first_name_leaves_nothing_none_of_its_rivals_is_followed():
    good = [found(10.0, "thruster_gain"), found(9.0, "thrust_advance")]
    for further in ({}, {("thruster_gain",): []}):
        asked = search(further)
        assert asked._looking_ahead(NULL, good, []) == good and asked.followed == ["thruster_gain"]


def test_pairs_found_from_their_other_name_are_not_fitted_again():
    payload, uneven = found(10.0, "payload"), found(8.0, "thrust_asymmetry")
    pair = found(380.0, "payload", "thrust_asymmetry")
    water = found(379.0, "thrust_asymmetry", "trapped_water")
    asked = search({("payload",): [pair], ("thrust_asymmetry",): [water]})
    assert names(asked._looking_ahead(NULL, [payload, uneven], [])) == ["thrust_asymmetry"]
    assert asked.followed == ["payload", "thrust_asymmetry"]
    ((key, (current, taken)),) = asked._leaders.known.items()
    assert key == (id(uneven), "payload") and current is uneven
    assert taken.explanation.effects == ("thrust_asymmetry", "payload") and taken.evidence == 380.0
    # Of two fits of the same the likelier one is kept.
    asked._leaders.take(uneven, found(381.0, "thrust_asymmetry", "payload"))
    asked._leaders.take(uneven, found(379.0, "thrust_asymmetry", "payload"))
    assert asked._leaders.known[key][1].evidence == 381.0
