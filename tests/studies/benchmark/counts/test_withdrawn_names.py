"""What a later step withdrew is no first name of an answer, in an ambiguous one either."""

from __future__ import annotations

import pytest

from auvnn.studies.benchmark.counts import counting, worlds


def answered(*groups, verdict="ambiguous", missing=("thrust_inflow_loss", "thrust_advance")):
    """Return a row with `thrust_advance` hidden and its steps, verdict and effects."""
    steps = [{"verdict": v, "effects": list(e)} for v, e in groups]
    return {
        "kind": "effect",
        "hidden": "thrust_advance",
        "verdict": verdict,
        "missing": list(missing),
        "found": steps,
    }


GROUP = ("ambiguous", ["thrust_inflow_loss", "thrust_advance"])


@pytest.mark.parametrize(("withdrawn", "wrong"), [(True, False), (False, True)])
def test_a_withdrawn_name_is_not_the_first_of_an_ambiguous_answer(withdrawn, wrong):
    last = [("withdrawn", ["payload"])] if withdrawn else []
    row = answered(("named", ["payload"]), GROUP, *last)
    assert worlds.wrong_first(row) is wrong
    assert counting.first_group(row) == (GROUP[1] if withdrawn else ["payload"])


@pytest.mark.parametrize(("distance", "right"), [(1.0, True), (4.6, False)])
def test_a_group_after_a_withdrawn_name_counts_where_nothing_tells_its_members_apart(distance, right):
    row = answered(("named", ["payload"]), GROUP, ("withdrawn", ["payload"]))
    row["imitation"] = {"thrust_advance": {"thrust_inflow_loss": distance}}
    assert counting.named_or_tied(row) is right


def test_an_answer_without_steps_has_what_is_missing_first():
    assert counting.first_group(answered(("unknown", []))) == ["thrust_inflow_loss", "thrust_advance"]
