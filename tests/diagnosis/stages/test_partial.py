"""The fit without one of several names is that of the search where it has been there, and is made anew elsewhere."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis.stages.partial import without


def fitted(*effects, windows=4):
    return SimpleNamespace(effects=effects, fitted=SimpleNamespace(initial=np.zeros((windows, 13))))


@pytest.mark.parametrize(
    ("name", "windows", "base", "known"),
    [
        ("waves", 4, [], ["tether", "net_buoyancy"]),
        # The search never had these two without the one between them.
        ("net_buoyancy", 4, [], None),
        # Other windows than those of the search; and a coefficient that stays free without its name.
        ("waves", 5, [], None),
        ("waves", 4, ["waves"], None),
    ],
)
def test_a_fit_of_the_search_is_not_made_again(name, windows, base, known):
    made = fitted("made anew")
    chooser = SimpleNamespace(without=lambda *_, **__: made)
    asked: Any = SimpleNamespace(base=base, chooser=lambda _: chooser)
    path = (fitted("net_buoyancy"), fitted("net_buoyancy", "tether"))
    state: Any = SimpleNamespace(first=fitted(), path=path, windows=None)
    found: Any = fitted("net_buoyancy", "tether", "waves", windows=windows)
    expected = made if known is None else path[1]
    assert without(asked, state, found, name) is expected
    alone: Any = fitted("waves")
    assert (without(asked, state, alone, "waves") is state.first) is (not base)
