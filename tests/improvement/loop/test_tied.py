"""Names of a diagnosis as the loop takes them: one of those between which the log cannot tell."""

from __future__ import annotations

import pytest

from auvnn.improvement.loop.causes import tied


def step(verdict, *effects):
    return {"verdict": verdict, "effects": list(effects), "p_value": 0.0}


@pytest.mark.parametrize(
    ("missing", "steps", "groups"),
    [
        (["a"], [step("named", "a"), step("adequate")], [["a"]]),
        (["a", "b", "c"], [step("named", "a"), step("ambiguous", "b", "c")], [["a"], ["b", "c"]]),
        (["a", "b"], [step("ambiguous", "a", "b")], [["a", "b"]]),
        (["a", "b"], [step("named", "a", "b")], [["a"], ["b"]]),
        (["b"], [step("named", "a"), step("withdrawn", "a"), step("named", "b")], [["b"]]),
        (["a"], [], [["a"]]),
        ([], [step("unknown")], []),
    ],
)
def test_groups_follow_the_steps(missing, steps, groups):
    assert tied(missing, steps) == groups
