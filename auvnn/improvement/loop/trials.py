"""One step of the loop: fit a trial, accept it if it pays on what was left out, and say so."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvnn.diagnosis.cross_validation.errors import gain
from auvnn.errors import AuvnnError
from auvnn.improvement.loop import learned
from auvnn.improvement.loop.answer import CAUSE, PREDICTS, Step
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.state import (
    Recipe,
    State,
    as_given,
    fitted,
    laid_out,
    parameters,
    starting,
)
from auvnn.logs import Log
from auvnn.metrics.derivative import choose_derivative
from auvnn.models import GreyBox
from auvnn.progress import Counted

# Numerical failures of one step: the step is reported and left out, the loop goes on.
FAILURES = (FloatingPointError, np.linalg.LinAlgError, RuntimeError, ValueError, ArithmeticError, AuvnnError)
# Steps that are reported: a comparison, three refits, a diagnosis, four rounds of a look at the catalogue and three fits,
# twice a learned term with two fits, other windows, and the judgement.
EXPECTED = 30


class Trials:
    """What every stage of the loop shares: the time, the story, trial fits, and what is taken.

    Attributes:
        state: the model that has been accepted so far.
        steps: what was taken.
        tried: what was tried and not taken.
        story: what was done and found.
        adequate: the diagnosis found nothing (more) that is missing.
    """

    def __init__(
        self,
        model: GreyBox,
        log: Log,
        derivative: dict[str, Any] | None,
        effects: Sequence[str] | None,
        max_effects: int,
        seconds: float,
        progress: Callable[[str], None] | None,
        tell: Callable[[str], None] | None,
    ) -> None:
        """Cut the log and look at the model as given."""
        self.began, self.limit = time.monotonic(), seconds
        self.say, self.tell = Counted(progress, EXPECTED, rough=True), tell or (lambda words: None)
        self.model, self.log = model, log
        self.how = choose_derivative(log, derivative)
        self.judge = Judge.of(log, model.actuation, model)
        self.state = as_given(model, self.judge)
        self.effects, self.max_effects = effects, max_effects
        self.steps: list[Step] = []
        self.tried: list[Step] = []
        self.story: list[str] = []
        self.warnings: list[str] = [*model.vehicle.warnings, *log.quality().reservations]
        self.diagnoses: list[dict[str, Any]] = []
        self.adequate = False
        self.stopped = "nothing more improves the prediction of what was left out"
        # The fit that others begin from: the refitted coefficients, whether they improved the model alone or not.
        self.ground: State | None = None

    def told(self, words: str) -> None:
        """Add a sentence to the story."""
        self.story.append(words)
        self.tell(words)

    def late(self) -> bool:
        """Whether the time is up."""
        if time.monotonic() - self.began <= self.limit:
            return False
        self.stopped = f"the time was up (seconds={self.limit:g})"
        return True

    def _start(self, state: State | None) -> np.ndarray | None:
        """Return the fit one step ahead as a place to begin from, or None where running free it is no better."""
        if state is None or state.left.total >= self.state.left.total:
            return None
        layout, names, held = laid_out(self.model, Recipe())
        return starting(layout, names, held, state, probes=False)

    def _add_best(self, group: Sequence[str], kind: str, reason: str, *, rivals: bool = False) -> bool:
        """Fit each of a group, take the one that predicts best if it pays, and say so."""
        found = []
        for name in group:
            if name in self.state.recipe.effects or self._full() or self.late():
                continue
            recipe = self._recipe(name)
            state = self._try(
                lambda recipe=recipe: fitted(self.model, self.judge, recipe, self._before()),
                f"fitting {name}",
            )
            if state is not None:
                found.append((name, state))
        if not found:
            return False
        name, best = min(found, key=lambda item: item[1].left.total)
        others = ", ".join(n for n in group if n != name)
        for other, state in found:
            if other != name:
                self._note(state, other, kind, False, f"{name} predicts better")
        return self._take(
            best, name, kind, f"{reason}, one of a tie with {others}" if rivals and others else reason
        )

    def _full(self) -> bool:
        named = [s for s in self.steps if s.kind in (CAUSE, PREDICTS)]
        return len(named) >= self.max_effects

    def _recipe(self, name: str) -> Recipe:
        begin = self._before()
        recipe = Recipe() if begin is None else begin.recipe
        return replace(recipe, effects=(*self.state.recipe.effects, name), objective="rollout")

    def _before(self) -> State | None:
        """Return the fit from which the next begins: the last accepted one, if it was fitted by free running."""
        return self.state if self.state.fit is not None else self.ground

    def _try(self, make: Callable[[], State], words: str) -> State | None:
        """Make a state; a fit that fails is reported and left out."""
        self.say(words)
        try:
            state = make()
        except FAILURES as problem:
            self._failed(words, problem)
            return None
        return state if np.isfinite(state.left.total) else None

    def _failed(self, words: str, problem: Exception) -> None:
        self.warnings.append(
            f"{words} failed and was left out: {type(problem).__name__}: {str(problem)[:200]}"
        )

    def _note(self, state: State, step: str, kind: str, accepted: bool, reason: str) -> Step:
        won = gain(self.state.left, state.left)
        found = Step(
            step, kind, accepted, {**won.to_dict()}, won.before, won.after, state.recipe.words(),
            parameters(state), reason, state.model if accepted else None, learned.used(state) if accepted else {},
        )  # fmt: skip
        (self.steps if accepted else self.tried).append(found)
        return found

    def _take(self, state: State, step: str, kind: str, reason: str) -> bool:
        """Accept a step if it pays on what was left out, and say so."""
        won = gain(self.state.left, state.left)
        pays = won.beyond(1.0)
        fall = f"fall {won.value:.2g} +- {won.std:.1g}"
        words = f"{won.before:.3f} -> {won.after:.3f} on what was left out ({fall})"
        if pays:
            self._note(state, step, kind, True, reason)
            self.state = state
            self.told(f"Taken: {_named(step, kind, reason)}: {words}.")
        else:
            self._note(state, step, kind, False, "does not pay on what was left out")
            self.told(f"Not taken: {_named(step, kind)}: {words}.")
        return pays


def _named(step: str, kind: str, reason: str = "") -> str:
    """Return a step with what kind it is and why, each said once."""
    more = "; ".join(w for w in (kind, reason) if w and w != step)
    return f"{step} ({more})" if more else step
