"""Names that leave next to nothing beside noise that is not white stand, and what is left beside them is told."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvnn.diagnosis import diagnose
from auvnn.diagnosis.noise_law import answer, standing_names
from auvnn.diagnosis.noise_law.noise_colour import Colour
from auvnn.diagnosis.noise_law.standing_names import beside_names, stand
from auvnn.models import GreyBox
from tests.diagnosis.noise_law.wandering import wandering_log
from tests.small_logs import small_vehicle

COLOURED = Colour(SimpleNamespace(), 10.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("before", "after", "expected"),
    [
        # Above the noise's square as shares of it: of 1.85 a twentieth is left, or of 0.10 a fifth.
        (1.85, 0.10, True),
        (0.104, 0.019, True),
        # Most of it is left, or a force that moves the vehicle is.
        (0.10, 0.05, False),
        (6.0, 0.3, False),
        (6.0, 1.5, False),
    ],
)
def test_what_names_leave_decides(monkeypatch, before, after, expected):
    monkeypatch.setattr(standing_names, "above_noise", lambda fitted: fitted)
    state: Any = SimpleNamespace(
        chosen=("payload",),
        refuted=None,
        first=SimpleNamespace(fitted=before),
        current=SimpleNamespace(fitted=after),
    )
    assert stand(state, COLOURED) is expected
    # Where the noise is white the comparison beside a force decides, and where nothing is named nothing stands.
    assert not stand(state, Colour(None, 0.0))
    state.chosen = ()
    assert not stand(state, COLOURED)
    state.chosen, state.refuted = ("payload",), SimpleNamespace()
    assert not stand(state, COLOURED)


@pytest.mark.long
def test_names_that_stand_keep_their_values_and_the_force_beside_them_is_told(monkeypatch):
    model, rms = GreyBox(small_vehicle()), np.array([4.0, 4.0, 4.0, 0.4, 0.4, 0.5])
    plant = model.with_effects({"net_buoyancy": {"force": 40.0}})
    log = wandering_log(plant, rms, 1.0, runs=2, duration=40.0, seed=4)
    ask = lambda stochastic: diagnose(  # noqa: E731
        model, log, ["net_buoyancy"], advice=False, whiteness=False, stochastic=stochastic
    )
    monkeypatch.setattr(answer, "stand", lambda state, colour: bool(state.chosen))
    # The law goes with the stated inertia; told is the force of the fitted one, which here is the same.
    told, newtons = [], standing_names.in_newtons
    monkeypatch.setattr(standing_names, "in_newtons", lambda *given: told.append(newtons(*given)) or told[-1])
    plain, found = ask(False), ask(True)
    assert plain.missing == found.missing == ["net_buoyancy"] and found.verdict == "named"
    (one,), (other,) = plain.candidates, found.candidates
    assert one["parameters"] == other["parameters"]
    # What is left is no riddle, but a force with a law.
    assert [s["verdict"] for s in plain.steps] == ["named", "unknown"]
    assert [s["verdict"] for s in found.steps] == ["named"]
    (law,) = told
    assert [found.stochastic["force"][axis]["rms"] for axis in "XYZ"] == pytest.approx(law.rms[:3])
    for axis in "XYZ":
        assert found.stochastic["force"][axis]["rms"] == pytest.approx(4.0, rel=0.3)


@pytest.mark.parametrize("left", [None, ["tilted_vertical"], []])
def test_names_stand_only_where_the_log_needs_each_of_them_beside_the_force(monkeypatch, left):
    asked: Any = SimpleNamespace(floor=None, most=4)
    end, first = SimpleNamespace(effects=("added_mass", "tilted_vertical")), SimpleNamespace(effects=())
    state: Any = SimpleNamespace(current=end, first=first, windows="windows", but=lambda **changes: changes)
    found = SimpleNamespace(name="found")
    result = SimpleNamespace(estimate=SimpleNamespace(law="law"), predicted="an input")
    path = None if left is None else SimpleNamespace(chosen=left)

    class Under:
        def __init__(self, asked: Any, windows: Any, *, closed_loop: bool) -> None:
            assert closed_loop and windows == "parts"

        def begin(self, *_: Any) -> Any:
            return found

        def changed(self, named: Any, before: Any) -> Any:
            assert named is found and before is state
            return path

        def go_on(self, along: Any, without: Any, before: Any, most: int) -> Any:
            assert along is path and without is first and before is state and most == 4
            return result

        def predicted(self, _: Any) -> Any:
            raise RuntimeError("the names stand")

    def ended(_: Any, before: Any, over: Any, what: Any, uncertain: Any, *, chance: bool) -> Any:
        assert before is state and over == {"first": first, "windows": "parts"}
        assert what is result and not chance
        return "with other names"

    monkeypatch.setattr(standing_names, "ForceSearch", Under)
    monkeypatch.setattr(standing_names, "leaves_force", lambda *_: True)
    monkeypatch.setattr(standing_names, "fitted_over_parts", lambda asked, fit, windows: (fit, "parts"))
    monkeypatch.setattr(standing_names, "white", lambda *_: None)
    monkeypatch.setattr(standing_names, "state_with", ended)
    uncertain: Any = SimpleNamespace(closed_loop=True)

    def ask() -> Any:
        return beside_names(asked, state, uncertain, lambda *also: also)  # type: ignore[arg-type,return-value]

    if left is None:
        with pytest.raises(RuntimeError, match="stand"):
            ask()
    elif left:
        assert ask() == ("with other names", "law", "an input")
    else:
        # None of the names is needed: names are sought beside the force as if there had been none.
        assert ask() == (asked, state, uncertain)
