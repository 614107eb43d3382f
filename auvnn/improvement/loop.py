"""The whole loop: check, compare, diagnose, add what pays, again until nothing pays, learn the rest, and the budget.

Names of causes come from the diagnosis. What it cannot name is looked for by prediction: the catalogue, linearised, then
drag of every coupling, then a force of what was measured. Every step, whoever proposed it, is fitted and accepted by one
figure: free running on what was left out of `log` improves by more than its own standard error. `test` chooses nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auvnn.diagnosis.diagnose import diagnose
from auvnn.diagnosis.hypotheses.candidates import candidates_for
from auvnn.diagnosis.left_out import gain
from auvnn.errors import AuvnnError, ConfigError
from auvnn.improvement import learned
from auvnn.improvement.answer import CAUSE, LEARNED, PREDICTS, REFITTED, Improved, Step
from auvnn.improvement.budget import budget
from auvnn.improvement.excerpt import liveliest
from auvnn.improvement.judge import Judge
from auvnn.improvement.screen import PROMISE, Promise, promises, wanted
from auvnn.improvement.state import (
    Recipe,
    State,
    as_given,
    fitted,
    fitted_one_step,
    laid_out,
    parameters,
    starting,
)
from auvnn.logs import Log
from auvnn.logs.leakage import leakage
from auvnn.metrics.derivative import choose_derivative
from auvnn.models import GreyBox
from auvnn.models.taking import GivenLog, GivenModel, as_log, as_model
from auvnn.threads import on_one_thread

# Numerical failures of one step: the step is told and left out, the loop goes on.
FAILURES = (FloatingPointError, np.linalg.LinAlgError, RuntimeError, ValueError, ArithmeticError, AuvnnError)
# Names that are fitted in one round of the search by prediction; how many of them may fail before it ends.
FITTED = 3
# A diagnosis sees at most so many seconds of a log.
DIAGNOSED = 300.0
# Share of the time after which a diagnosis is broken off: prediction shall have its turn.
PATIENCE = 0.3
# Rounds of diagnosis at most.
ROUNDS = 3


@on_one_thread
def improve(
    model: GivenModel,
    log: GivenLog,
    *,
    test: GivenLog | None = None,
    effects: str | Sequence[str] | None = None,
    learn: Sequence[str] = learned.KINDS,
    max_effects: int = 8,
    seconds: float = 600.0,
    diagnosing: bool = True,
    derivative: dict[str, Any] | None = None,
    force: bool = False,
    progress: Callable[[str], None] | None = None,
    tell: Callable[[str], None] | None = None,
) -> Improved:
    """Walk the loop until nothing pays, and return the model, its history and the error budget.

    Args:
        model: as known; it is not changed.
        log: measurements; everything is chosen and fitted here, by leaving parts of it out in turn.
        test: what the budget is judged on, once, at the end; by default the last run of `log`, or the last 30 % of a
            single one, which is then not fitted.
        effects: names that may be added; the whole catalogue by default.
        learn: what may be learned where names end: "polynomial" (drag of every coupling), "residual_force".
        max_effects: add at most this many names.
        seconds: start nothing new after this time; what has been accepted by then is kept.
        diagnosing: ask the diagnosis for causes; without it names are looked for by prediction alone.
        derivative: how accelerations are obtained where they were not measured.
        force: go on with a log that contradicts itself: signs, units, axes.
        progress: told in words what is being done.
        tell: told the story, sentence by sentence, as it happens.

    Raises:
        ConfigError: an unknown effect, or unknown kind of what may be learned.
        InputError: the same data on both sides, a log that contradicts itself, or one that is too short.
    """
    log = as_log(log)
    model = as_model(model, log)
    test = None if test is None else as_log(test, "test")
    strange = [k for k in learn if k not in learned.KINDS]
    if strange:
        raise ConfigError(f"learn={strange[0]}: choose from {', '.join(learned.KINDS)}")
    held_out = f"{test.name} is held out" if test is not None else ""
    if test is None:
        log, test, held_out = log.split()
    else:
        leakage(log, test)
        test.quality().refuse_contradictions(force)
    log.quality().refuse_contradictions(force)
    names = None if effects is None else candidates_for(model, log, effects)[0]
    walk = Walk(model, log, derivative, names, max_effects, seconds, progress, tell)
    walk.check()
    walk.compare()
    walk.refit()
    if diagnosing:
        walk.diagnose()
    if not walk.adequate:
        walk.predict()
        for kind in learn:
            walk.learn(kind)
    walk.polish()
    return walk.end(test, held_out)


class _TooLong(Exception):
    """The time for a diagnosis is up."""


class Walk:
    """One walk around the loop.

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
        self.say, self.tell = progress or (lambda words: None), tell or (lambda words: None)
        self.model, self.log = model, log
        self.how = choose_derivative(log, derivative)
        self.judge = Judge.of(log, model.actuation)
        self.state = as_given(model, self.judge)
        self.effects, self.max_effects = effects, max_effects
        self.steps: list[Step] = []
        self.tried: list[Step] = []
        self.story: list[str] = []
        self.warnings: list[str] = [*model.vehicle.warnings, *log.quality().reservations]
        self.diagnoses: list[dict[str, Any]] = []
        self.adequate = False
        self.stopped = "nothing more pays on what was left out"
        # The fit that others begin from: the refitted coefficients, whether they paid by themselves or not.
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

    def check(self) -> None:
        """Say what the quality of the log is."""
        findings = self.log.quality().to_dict()["findings"]
        bad = [f for f in findings if f["level"] in ("error", "warning")]
        words = "; ".join(f"{f['where']}: {f['what']}" for f in bad[:3])
        more = f", and {len(bad) - 3} more (auvnn check shows them)" if len(bad) > 3 else ""
        self.told(f"Check: {words}{more}." if bad else "Check: nothing to complain of.")

    def compare(self) -> None:
        """Say where the model as given stands beside the plain regression and persistence."""
        self.say("running the model as given, and a plain regression beside it")
        self.regression = self.judge.regression(self.how)
        given = self.state.left
        self.told(
            f"Compare: over {self.judge.horizon} s of free running the model as given errs by {given.total:.3f} of the "
            f"motion's spread, a plain regression by {self.regression.total:.3f} ({self.judge.folds.words}), holding the "
            f"initial velocity by {given.persistence:.3f}."
        )

    def refit(self) -> None:
        """Refit the coefficients, by every objective, and keep the one that foresees best what was left out."""
        found: list[State] = []
        one_step = self._try(
            lambda: fitted_one_step(self.model, self.judge, Recipe(objective="one_step"), self.how),
            "refitting the coefficients one step ahead",
        )
        found += [one_step] if one_step else []
        longest = float(self.judge.horizon)
        for seconds in dict.fromkeys((longest, min(2.0, longest))):
            state = self._try(
                lambda seconds=seconds: fitted(
                    self.model, self.judge, Recipe(seconds=seconds), one_step, start=self._start(one_step)
                ),
                f"refitting the coefficients by free running over {seconds:g} s",
            )
            found += [state] if state else []
        if not found:
            self.told("Refit: no fit of the coefficients settled; they stay as stated.")
            return
        best = min(found, key=lambda s: s.left.total)
        by_rollout = [s for s in found if s.recipe.objective == "rollout"]
        self.ground = min(by_rollout, key=lambda s: s.left.total) if by_rollout else None
        for state in found:
            if state is not best:
                self._note(state, REFITTED, REFITTED, False, f"{best.recipe.words()} foresees more")
        self._take(best, REFITTED, REFITTED, "its stated uncertainties")

    def _start(self, state: State | None) -> np.ndarray | None:
        """Return the fit one step ahead as a place to begin from, or None where running free it is no better."""
        if state is None or state.left.total >= self.state.left.total:
            return None
        layout, names, held = laid_out(self.model, Recipe())
        return starting(layout, names, held, state, probes=False)

    def diagnose(self) -> None:
        """Ask which causes are missing, and add those that pay, until none is named or none pays."""
        part = liveliest(self.log, DIAGNOSED)
        if part is not self.log:
            self.told(
                f"Diagnose: on the liveliest {part.duration:.0f} s of the log's {self.log.duration:.0f} s."
            )
        for number in range(ROUNDS):
            if self.late() or self._full():
                return
            self.say(f"diagnosing what is missing ({number + 1})")
            patience = max(self.limit * PATIENCE - (time.monotonic() - self.began), 0.0)
            asked = (
                None
                if self.effects is None
                else [n for n in self.effects if n not in self.state.model.effect_names]
            )
            if asked is not None and not asked:
                return
            try:
                found = diagnose(
                    self.state.model,
                    part,
                    asked,
                    force=True,
                    advice=False,
                    whiteness=False,
                    costs=False,
                    progress=self._until(time.monotonic() + patience),
                )
            except _TooLong:
                self.told(
                    f"Diagnose: broken off, it took too long (seconds={self.limit:g} for everything): no cause is named "
                    "in this round."
                )
                return
            except FAILURES as problem:
                self._failed("the diagnosis", problem)
                return
            last = found.steps[-1]["verdict"] if found.steps else found.verdict
            self.diagnoses.append(
                {
                    "verdict": found.verdict,
                    "missing": found.missing,
                    "nearest": found.nearest,
                    "story": found.story,
                }
            )
            self.told(f"Diagnose: {' '.join(found.story)}")
            if found.verdict == "adequate":
                self.adequate = True
                return
            pays = False
            groups = [[n] for n in found.missing] if found.verdict == "named" else [list(found.missing)]
            for group in [g for g in groups if g]:
                pays |= self._add_best(
                    group, CAUSE, "named by the diagnosis", rivals=found.verdict != "named"
                )
            if not pays:
                return
            if found.verdict == "named" and last == "adequate":
                self.adequate = True
                return

    def _until(self, end: float) -> Callable[[str], None]:
        """Return who tells what is being done, and breaks it off after a time."""

        def say(words: str) -> None:
            if time.monotonic() > end:
                raise _TooLong
            self.say(words)

        return say

    def _add_best(self, group: Sequence[str], kind: str, reason: str, *, rivals: bool = False) -> bool:
        """Fit each of a group, take the one that foresees best if it pays, and say so."""
        found = []
        for name in group:
            if (
                name in self.state.recipe.effects
                or name in self.model.effect_names
                or self._full()
                or self.late()
            ):
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
                self._note(state, other, kind, False, f"{name} foresees more")
        return self._take(
            best, name, kind, f"{reason}, one of a tie with {others}" if rivals and others else reason
        )

    def predict(self) -> None:
        """Look for names that foresee better, whatever they stand for, until none pays."""
        names = wanted(self.model, self.judge, self.state.recipe)
        if self.effects is not None:
            names = [n for n in names if n in self.effects]
        near = [n for d in self.diagnoses for n in d["nearest"]]
        shortlist = names
        while not (self.late() or self._full()):
            shortlist = [n for n in shortlist if n not in self.state.recipe.effects]
            if not shortlist:
                return
            begin = self._before()
            promised = promises(self.model, self.judge, begin or self.state, shortlist, self.say)
            # Later rounds look again only at what promised anything.
            shortlist = [p.effect for p in promised if p.fall > PROMISE] or shortlist[:0]
            chosen = [p for p in promised if p.fall > PROMISE][:FITTED]
            if not chosen:
                return
            found: list[tuple[Promise, State]] = []
            for p in chosen:
                if self.late():
                    break
                recipe = self._recipe(p.effect)
                state = self._try(
                    lambda r=recipe, p=p, b=begin: fitted(self.model, self.judge, r, b, start=p.start),
                    f"fitting {p.effect}",
                )
                if state is not None:
                    found.append((p, state))
            if not found:
                return
            best, state = min(found, key=lambda item: item[1].left.total)
            for p, other in found:
                if p is not best:
                    self._note(other, p.effect, PREDICTS, False, f"{best.effect} foresees more")
            reason = "came near in the diagnosis" if best.effect in near else "promised most of the catalogue"
            if not self._take(state, best.effect, PREDICTS, reason):
                return

    def learn(self, kind: str) -> None:
        """Learn what has no name, if it pays."""
        if self.late():
            return
        begin = self._before() or self.state
        self.say(f"looking at {kind.replace('_', ' ')}")
        try:
            choices = learned.choose(self.model, self.judge, begin, kind)
        except FAILURES as problem:
            self._failed(f"learning ({kind})", problem)
            return
        name = learned.EFFECT[kind]
        if not choices and name not in self.state.recipe.effects:
            self.told(f"Learn: {name} promises nothing on what was left out.")
        found = []
        for choice in choices:
            state = self._try(
                lambda c=choice: fitted(self.model, self.judge, c.recipe, begin, steps=4),
                f"fitting {name} of {choice.words}",
            )
            if state is not None:
                found.append((choice, state))
        if not found:
            return
        choice, best = min(found, key=lambda item: item[1].left.total)
        for other, state in found:
            if other is not choice:
                self._note(
                    state, name, LEARNED, False, f"of {other.words}; of {choice.words} it foresees more"
                )
        held = choice.recipe.ridge[name]
        self._take(best, name, LEARNED, f"of {choice.words}, held within {held:g} of its scale")

    def polish(self) -> None:
        """Fit what has been taken over other lengths of windows, and keep what foresees best."""
        if self.state.fit is None or not self.steps or self.late():
            return
        own = self.state.recipe
        longest = float(self.judge.horizon)
        for seconds in (longest, min(2.0, longest)):
            if seconds == own.seconds or self.late():
                continue
            recipe = replace(own, seconds=seconds)
            state = self._try(
                lambda recipe=recipe: fitted(self.model, self.judge, recipe, self.state, steps=4),
                f"fitting everything by free running over {seconds:g} s",
            )
            if state is not None:
                self._take(state, f"windows of {seconds:g} s", REFITTED, "another length of windows")

    def end(self, test: Log, held_out: str) -> Improved:
        """Judge every step once on the test log."""
        self.say("judging every step on the held-out data")
        stages = [("as given", "as given", self.model)]
        stages += [(s.step, s.kind, s.model) for s in self.steps if s.model is not None]
        found = budget(stages, self.log, test, self.how)
        for row, left in zip(found["waterfall"], [None, *self.steps], strict=False):
            row["left_out"] = self._given_error if left is None else left.after
        left = self.state.left
        recipe = self.state.recipe
        fall = [w["error"] for w in found["waterfall"][:-1]]
        line = found["baseline"]
        self.told(
            f"Budget on {test.name}: {fall[0]:.3f} as given, {fall[-1]:.3f} at the end; plain regression "
            f"{line['total']:.3f}, holding the initial velocity {line['persistence']['total']:.3f}, "
            f"noise floor {found['waterfall'][-1]['error']:.3f}."
        )
        for other, words in (
            ("baseline", "the plain regression"),
            ("persistence", "holding the initial velocity"),
        ):
            if found["loses"][other]:
                self.warnings.append(
                    f"the model loses to {words} in {', '.join(found['loses'][other])} on {test.name}"
                )
        if fall[-1] > fall[0]:
            self.warnings.append(
                f"on {test.name} the model at the end is worse than as given: its data differ from the log's"
            )
        return Improved(
            name=self.model.vehicle.name,
            log=self.log.name,
            test=test.name,
            held_out=held_out,
            steps=self.steps,
            tried=self.tried,
            diagnoses=self.diagnoses,
            story=self.story,
            warnings=list(dict.fromkeys(self.warnings)),
            objective={
                "objective": recipe.objective,
                "window": recipe.seconds if recipe.objective == "rollout" else None,
                "words": recipe.words(),
            },
            folds=self.judge.folds.words,
            seconds=time.monotonic() - self.began,
            stopped=self.stopped,
            model=self.state.model,
            given=self.model,
            left_out={
                "total": left.total,
                **left.by_dof,
                "regression": self.regression.total,
                "horizon": left.horizon,
            },
            **found,
        )

    @property
    def _given_error(self) -> float:
        return self.steps[0].before if self.steps else self.state.left.total

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
        """Make a state; a fit that fails is told and left out."""
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
        words = f"{won.before:.3f} -> {won.after:.3f} on what was left out (fall {won.value:.3f} +- {won.std:.3f})"
        if pays:
            self._note(state, step, kind, True, reason)
            self.state = state
            self.told(f"Taken: {step} ({kind}; {reason}): {words}.")
        else:
            self._note(state, step, kind, False, "does not pay on what was left out")
            self.told(f"Not taken: {step} ({kind}): {words}.")
        return pays


__all__ = ["Improved", "improve"]
