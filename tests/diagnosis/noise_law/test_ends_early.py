"""A search that will be made again ends early, and goes on to its end where it need not be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law import answer
from auvnn.diagnosis.noise_law.commands.law import HELD
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench
from auvnn.diagnosis.noise_law.noise_colour import Colour
from auvnn.metrics.coloured_noise import NoiseColour

NOTHING: Any = SimpleNamespace(floor=None, layout=None, commands=None, say=lambda _: None)


class Stage(SimpleNamespace):
    """Where a search stands, as far as it is looked at."""

    def but(self, **changes: Any) -> Stage:
        return Stage(**{**self.__dict__, **changes})


@pytest.mark.parametrize(
    ("stays", "rounds", "force", "colour", "commands", "expected"),
    [
        (True, 3, False, False, False, True),
        (False, 1, True, True, False, True),
        (False, 1, True, False, True, True),
        # After further names, where nothing stays, or where neither is clear, the search goes on.
        (False, 2, True, True, True, False),
        (False, 1, False, True, True, False),
        (False, 1, True, False, False, False),
    ],
)
def test_a_search_ends_early_for_a_force_or_a_clear_colour_or_law_of_the_commands(
    monkeypatch, stays, rounds, force, colour, commands, expected
):
    monkeypatch.setattr(answer, "a_force_stays", lambda *_: stays)
    monkeypatch.setattr(answer, "leaves_force", lambda *_: force)
    monkeypatch.setattr(answer, "clearly_coloured", lambda *_: colour)
    monkeypatch.setattr(answer, "clearly_between_samples", lambda *_: commands)
    state: Any = SimpleNamespace(path=[None] * rounds, current=None, windows=None)
    assert answer.ends_early(NOTHING, state) is expected


def test_what_cannot_be_solved_ends_no_search(monkeypatch):
    def unsolved(*_: Any) -> bool:
        raise np.linalg.LinAlgError("free running grows without bound")

    monkeypatch.setattr(answer, "a_force_stays", lambda *_: False)
    monkeypatch.setattr(answer, "leaves_force", unsolved)
    state: Any = SimpleNamespace(path=[None], current=None, windows=None)
    assert not answer.ends_early(NOTHING, state)


def answered(monkeypatch, *, interrupted, force, coloured, leaves=True):
    """Return the searches that an answer makes, windows and whether they may end early, and the answer.

    The first search has ended early; those made again do so where they may, if `interrupted`.
    """
    begun: list[tuple[str, bool]] = []
    noise = NoiseColour(np.full(18, 0.3)) if coloured else None
    state: Any = Stage(
        leaves_something=True,
        windows="white",
        refuted=None,
        chosen=(),
        failed={"waves": "before"},
        interrupted=True,
    )

    def search(asked: Any, windows: str, until: Any = None) -> Stage:
        begun.append((windows, until is not None))
        early = interrupted and until is not None
        failed = {"tether" if early else "payload": "its fit failed"}
        return state.but(
            windows=windows, interrupted=early, failed=failed, leaves_something=leaves or not coloured
        )

    def beside(asked: Any, state: Stage, uncertain: Any) -> Any:
        if force == "unsolved":
            raise np.linalg.LinAlgError("no")
        return None if force is None else (state, None, None)

    monkeypatch.setattr(answer, "_held", lambda *_: (None, HELD))
    monkeypatch.setattr(answer, "without_timed", lambda *_: None)
    monkeypatch.setattr(answer, "uncertain_wrench", lambda *_: UncertainWrench(np.zeros(6), np.zeros(6), 0.1))
    monkeypatch.setattr(answer, "noise_colour", lambda *_: Colour(noise, 5000.0))
    monkeypatch.setattr(Colour, "applied", lambda self, windows: "coloured")
    monkeypatch.setattr(answer, "search", search)
    monkeypatch.setattr(answer, "_with_force", beside)
    monkeypatch.setattr(answer, "left", lambda law: {})
    return begun, *answer.answer_with_force(NOTHING, state)


@pytest.mark.parametrize(
    ("interrupted", "force", "searches"),
    [(True, None, 2), (False, None, 1), (True, "told", 1), (True, "unsolved", 2)],
)
def test_a_search_with_another_colour_goes_on_where_no_force_is_told(
    monkeypatch, interrupted, force, searches
):
    """The first of the searches has the colour and may end early; the second goes to the end over the same windows."""
    begun, found, told, words = answered(monkeypatch, interrupted=interrupted, force=force, coloured=True)
    assert begun == [("coloured", True), ("coloured", False)][:searches]
    assert ("force" in told) is (force == "told") and bool(words) is (force == "unsolved")
    assert found.interrupted is (force == "told")
    assert told["noise"] and found.windows == "coloured"
    # What could not be fitted before the early end is told beside what could not afterwards.
    whole = {"payload"} if searches == 2 or not interrupted else set()
    assert {*found.failed} == whole | ({"tether"} if interrupted else set())


def test_names_that_end_early_and_leave_nothing_go_on(monkeypatch):
    begun, found, told, _ = answered(monkeypatch, interrupted=True, force=None, coloured=True, leaves=False)
    assert begun == [("coloured", True), ("coloured", False)] and not found.interrupted and told["noise"]


@pytest.mark.parametrize(("force", "searches"), [(None, 1), ("told", 0)])
def test_a_search_that_ended_early_goes_on_where_no_force_is_told(monkeypatch, force, searches):
    """With commands and noise as they were, the whole search is asked of both anew."""
    begun, found, told, _ = answered(monkeypatch, interrupted=True, force=force, coloured=False)
    assert begun == [("white", False)] * searches
    assert ("force" in told) is (force == "told") and found.interrupted is (force == "told")


def test_a_search_that_ended_early_and_leaves_nothing_goes_on(monkeypatch):
    begun = []

    def search(asked: Any, windows: str, until: Any = None) -> Stage:
        begun.append(windows)
        return Stage(leaves_something=False, windows=windows, chosen=(), interrupted=False)

    monkeypatch.setattr(answer, "search", search)
    state: Any = Stage(leaves_something=False, windows="white", chosen=(), interrupted=True)
    found, told, words = answer.answer_with_force(NOTHING, state)
    assert begun == ["white"] and not found.interrupted and (told, words) == ({}, [])
