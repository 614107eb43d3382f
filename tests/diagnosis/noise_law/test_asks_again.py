"""A search that will be made again ends early, and goes on to its end where it need not be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.noise_law import answer
from auvnn.diagnosis.noise_law.commands.holding import HELD
from auvnn.diagnosis.noise_law.commands.uncertain import UncertainWrench
from auvnn.diagnosis.noise_law.noise_colour import Colour
from auvnn.metrics.coloured_noise import NoiseColour

NOTHING: Any = SimpleNamespace(floor=None, say=lambda _: None)


class Stage(SimpleNamespace):
    """Where a search stands, as far as it is looked at."""

    def but(self, **changes: Any) -> Stage:
        return Stage(**{**self.__dict__, **changes})


@pytest.mark.parametrize(
    ("stays", "rounds", "force", "clear", "expected"),
    [
        (True, 3, False, False, True),
        (False, 1, True, True, True),
        # After further names, where nothing stays, or where the colour is not clear, the search goes on.
        (False, 2, True, True, False),
        (False, 1, False, True, False),
        (False, 1, True, False, False),
    ],
)
def test_a_search_ends_early_for_a_force_or_a_clear_colour(
    monkeypatch, stays, rounds, force, clear, expected
):
    monkeypatch.setattr(answer, "a_force_stays", lambda *_: stays)
    monkeypatch.setattr(answer, "leaves_force", lambda *_: force)
    monkeypatch.setattr(answer, "clearly_coloured", lambda *_: clear)
    state: Any = SimpleNamespace(path=[None] * rounds, current=None, windows=None)
    assert answer.asks_again(NOTHING, state) is expected


def test_what_cannot_be_solved_ends_no_search(monkeypatch):
    def unsolved(*_: Any) -> bool:
        raise np.linalg.LinAlgError("free running grows without bound")

    monkeypatch.setattr(answer, "a_force_stays", lambda *_: False)
    monkeypatch.setattr(answer, "leaves_force", unsolved)
    state: Any = SimpleNamespace(path=[None], current=None, windows=None)
    assert not answer.asks_again(NOTHING, state)


@pytest.mark.parametrize(
    ("interrupted", "force", "searches"),
    [(True, None, 2), (False, None, 1), (True, "told", 1), (True, "unsolved", 2)],
)
def test_a_search_with_another_colour_goes_on_where_no_force_is_told(
    monkeypatch, interrupted, force, searches
):
    """The first of the searches has the colour and may end early; the second goes to the end over the same windows."""
    begun: list[tuple[str, bool]] = []
    colour = Colour(NoiseColour(np.full(18, 0.3)), 5000.0)
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
        return state.but(windows=windows, interrupted=interrupted and until is not None, failed={})

    def beside(asked: Any, state: Stage, uncertain: Any) -> Any:
        if force == "unsolved":
            raise np.linalg.LinAlgError("no")
        return None if force is None else (state, None, None)

    monkeypatch.setattr(answer, "_held", lambda _: (None, HELD))
    monkeypatch.setattr(answer, "without_timed", lambda *_: None)
    monkeypatch.setattr(answer, "uncertain_wrench", lambda *_: UncertainWrench(np.zeros(6), np.zeros(6), 0.1))
    monkeypatch.setattr(answer, "noise_colour", lambda *_: colour)
    monkeypatch.setattr(Colour, "applied", lambda self, windows: "coloured")
    monkeypatch.setattr(answer, "search", search)
    monkeypatch.setattr(answer, "_with_force", beside)
    monkeypatch.setattr(answer, "left", lambda law: {})
    found, told, words = answer.answer_with_force(NOTHING, state)
    assert begun == [("coloured", True), ("coloured", False)][:searches]
    assert ("force" in told) is (force == "told") and bool(words) is (force == "unsolved")
    # Whoever asked must not begin anew: what was made over these windows is the whole of it.
    assert not found.interrupted or force == "told"
