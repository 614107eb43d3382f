"""What was made is used again while its numbers are as they were, and the oldest is forgotten."""

from __future__ import annotations

import torch

from auvnn.compiled.known_code import KnownCode, Made

ROW = torch.tensor([1.0, 0.0, 2.0], dtype=torch.float64)


def maker(made, code="code", places=(1,)):
    fixed = torch.tensor(places)

    def make():
        made.append(code)
        return Made([], code, "", fixed, ROW[fixed].clone())

    return make


def test_it_is_made_once_and_again_where_a_number_of_the_code_has_changed():
    known, made = KnownCode(4), []
    for row in (ROW, ROW, torch.tensor([5.0, 0.0, 7.0], dtype=torch.float64)):
        assert known.get("a model", row, maker(made)).code == "code"
    assert made == ["code"]
    known.get("a model", torch.tensor([1.0, 3.0, 2.0], dtype=torch.float64), maker(made))
    known.get("another", ROW, maker(made))
    assert len(made) == 3 and len(known) == 2


def test_the_oldest_is_forgotten():
    known, made = KnownCode(2), []
    for key in "abc":
        known.get(key, ROW, maker(made, key))
    assert len(known) == 2
    known.get("b", ROW, maker(made, "b"))
    assert made == ["a", "b", "c"]
    known.get("a", ROW, maker(made, "a"))
    assert made == ["a", "b", "c", "a"]
    known.clear()
    assert len(known) == 0


def test_what_is_impossible_is_remembered_with_its_reason():
    known, asked = KnownCode(2), []

    def make():
        asked.append(1)
        return Made([], None, "no compiler")

    assert [known.get("a", ROW, make).reason for _ in range(2)] == ["no compiler"] * 2
    assert asked == [1] and known.get("a", ROW, make).code is None
