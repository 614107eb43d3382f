"""Counts of steps that long work tells of: each call begins a step, and work inside a step is none."""

from __future__ import annotations

from auvnn.progress import Counted, Progress, each


def heard(found):
    return lambda words: found.append((str(words), words.done, words.total, words.rough))


def test_each_call_begins_a_step_and_the_last_one_is_the_last():
    found = []
    say = Counted(heard(found), 3)
    for words in "abc":
        say(words)
    assert found == [("a", 0, 3, False), ("b", 1, 3, False), ("c", 2, 3, False)]


def test_what_is_expected_roughly_grows_and_never_ends_before_the_work_does():
    found = []
    say = Counted(heard(found), 2, rough=True)
    for k in range(6):
        say(str(k))
    assert [done for _, done, _, _ in found] == list(range(6))
    assert all(total > done and rough for _, done, total, rough in found)


def test_work_inside_a_step_is_told_and_is_no_step():
    found = []
    say = Counted(heard(found), 2)
    say("fitting")
    for k in range(3):
        say(Progress("part", k, 3))
    say("judging")
    assert [f[:2] for f in found] == [
        ("fitting", 0), ("part, 1 of 3", 0), ("part, 2 of 3", 0), ("part, 3 of 3", 0), ("judging", 1),
    ]  # fmt: skip


def test_each_tells_before_an_item_comes_and_nothing_to_nobody():
    found = []
    items = list(each(["x", "y"], heard(found), lambda item: f"reading {item}"))
    assert items == ["x", "y"] and found == [("reading x", 0, 2, False), ("reading y", 1, 2, False)]
    assert list(each([1], None, str)) == [1]
    Counted(None, 2)("nobody hears")
