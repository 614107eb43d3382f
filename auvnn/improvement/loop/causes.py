"""Check, compare, refit, diagnose: causes come from the diagnosis, and what pays is added."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.cross_validation.errors import gain
from auvnn.diagnosis.diagnose import diagnose
from auvnn.diagnosis.hypotheses.candidates import candidates_for
from auvnn.improvement.commands_between import GONE, path_of, states_for
from auvnn.improvement.loop.answer import CAUSE, REFITTED
from auvnn.improvement.loop.excerpt import liveliest
from auvnn.improvement.loop.judge import Judge
from auvnn.improvement.loop.state import (
    Recipe,
    State,
    as_given,
    fitted,
    fitted_one_step,
)
from auvnn.improvement.loop.trials import FAILURES, Trials
from auvnn.logs import Log
from auvnn.models.actuation.command_path import CommandPath, with_commands

# A diagnosis sees at most so many seconds of a log.
DIAGNOSED = 300.0
# Share of the time after which a diagnosis is broken off: prediction shall have its turn.
PATIENCE = 0.3
# Rounds of diagnosis at most; how often it begins anew because commands go otherwise beside the names.
ROUNDS, CHANGES = 3, 2
# Shares of the next command that are about the same.
SHARES = 0.1
OTHERWISE = "fitted to commands that go otherwise between samples"
HELD = "commands are held until the next sample, or the log does not tell."


class _TooLong(Exception):
    """The time for a diagnosis is up."""


class Causes(Trials):
    """The stages that look at the model as given, refit it, and ask the diagnosis for causes."""

    def check(self) -> None:
        """Say what the quality of the log is."""
        findings = self.log.quality().to_dict()["findings"]
        bad = [f for f in findings if f["level"] in ("error", "warning")]
        words = "; ".join(f"{f['where']}: {f['what']}" for f in bad[:3])
        more = f", and {len(bad) - 3} more (auvnn check shows them)" if len(bad) > 3 else ""
        self.told(f"Check: {words}{more}." if bad else "Check: nothing to complain of.")

    def commands(self) -> None:
        """Ask how commands go between samples; where they are not held, everything is fitted and judged as they go."""
        self.say("asking how commands go between samples")
        try:
            path = path_of(self.model, liveliest(self.log, DIAGNOSED))
        except FAILURES as problem:
            self._failed("asking how commands go between samples", problem)
            return
        other = states_for(self.model, self._interval())
        if path is not None or other:
            self.told(GONE if path is None else path.words())
            self.model = with_commands(self.model, path)
            self.judge = Judge.of(self.log, self.model.actuation, self.model)
            self.state = as_given(self.model, self.judge)

    def compare(self) -> None:
        """Say how the model as given compares with the plain regression and persistence."""
        self.say("running the model as given, and a plain regression for comparison")
        self.regression = self.judge.regression(self.how)
        given = self.state.left
        self.told(
            f"Compare: over {self.judge.horizon} s of free running the model as given errs by {given.total:.3f} of the "
            f"motion's spread, a plain regression by {self.regression.total:.3f} ({self.judge.folds.words}), holding the "
            f"initial velocity by {given.persistence:.3f}."
        )

    def refit(self) -> None:
        """Refit the coefficients, by every objective, and keep the one that predicts best what was left out."""
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
                self._note(state, REFITTED, REFITTED, False, f"{best.recipe.words()} predicts better")
        self._take(best, REFITTED, REFITTED, "its stated uncertainties")

    def diagnose(self) -> None:
        """Ask which causes are missing, and add those that pay; and again, where commands go otherwise beside them."""
        part = liveliest(self.log, DIAGNOSED)
        if part is not self.log:
            self.told(
                f"Diagnose: on the liveliest {part.duration:.0f} s of the log's {self.log.duration:.0f} s."
            )
        share = self.limit * PATIENCE
        self._rounds(part, self.began + share)
        for _ in range(CHANGES):
            # Names that predict a part, or come nearest, hide as much of the commands as those that are causes.
            names = self.state.recipe.effects or tuple(
                self.diagnoses[-1]["nearest"] if self.diagnoses else ()
            )
            if not names or self.late():
                return
            path, same = self._beside(names, part)
            if same:
                return
            kept = self.model, self.judge, self.state, self.ground, self.adequate, self.regression
            steps, diagnoses = self.steps, list(self.diagnoses)
            self._begin_anew(path, names)
            self.refit()
            # Both times together may take twice the share of one.
            self._rounds(part, min(time.monotonic(), self.began + share) + share)
            won = gain(kept[2].left, self.state.left)
            worse = not won.value > -won.std
            lost = self.steps if worse else steps
            self.tried += [replace(s, accepted=False, reason=OTHERWISE, model=None) for s in lost]
            if worse:
                self.model, self.judge, self.state, self.ground, self.adequate, self.regression = kept
                self.steps, self.diagnoses = steps, diagnoses
                self.told("With that it predicts worse: commands are taken as before.")
                return

    def _beside(self, names: Sequence[str], part: Log) -> tuple[CommandPath | None, bool]:
        """Return how commands go by a fit with names, and whether they are taken so: what is missing hides it."""
        stated = self.model.commands
        before = stated if states_for(self.model, self._interval()) else None
        self.say("asking how commands go between samples, beside the names")
        try:
            path = path_of(self.model, part, names)
        except FAILURES as problem:
            self._failed("asking how commands go between samples, beside the names", problem)
            return before, True
        if path is None or before is None:
            return path, path is before
        same = ("between_samples", "samples", "interpolated")
        alike = all(getattr(path, k) == getattr(before, k) for k in same)
        return path, alike and abs(path.share_of_next - before.share_of_next) < SHARES

    def _begin_anew(self, path: CommandPath | None, names: Sequence[str]) -> None:
        """Go back to the model as given, with another statement of how commands go, that was found beside names."""
        self.told(
            f"Beside {', '.join(names)}: {HELD if path is None else path.words()} Everything is fitted again."
        )
        self.model = with_commands(self.model, path)
        self.judge = Judge.of(self.log, self.model.actuation, self.model)
        self.regression = self.judge.regression(self.how)
        self.state, self.steps = as_given(self.model, self.judge), []
        self.ground, self.adequate = None, False

    def _interval(self) -> float:
        """Return the usual interval between samples of the log, s."""
        return float(np.median([run.dt for run in self.log.runs]))

    def _rounds(self, part: Log, until: float) -> None:
        """Ask for causes, add those that pay, and ask again, until none is named or none pays.

        Args:
            part: of the log, that is diagnosed.
            until: when the time for it is up, as `time.monotonic` has it.
        """
        for number in range(ROUNDS):
            if self.late() or self._full():
                return
            self.say(f"diagnosing what is missing ({number + 1})")
            # What this loop has put in was fitted to this log.
            usable = candidates_for(self.model, self.log, self.effects, stated=True)[0]
            asked = [n for n in usable if n not in self.state.recipe.effects]
            if not asked:
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
                    # What a name is worth is decided by free running here, and time is bounded.
                    stochastic=False,
                    progress=self._until(until),
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
            for group in tied(found.missing, found.steps):
                pays |= self._add_best(group, CAUSE, "named by the diagnosis", rivals=len(group) > 1)
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


def tied(missing: Sequence[str], steps: Sequence[SearchStep]) -> list[list[str]]:
    """Return the names of a diagnosis in groups, in order: of those between which the log cannot tell one is missing.

    Args:
        missing: all names.
        steps: what was found one after the other.
    """
    left, groups = dict.fromkeys(missing), list[list[str]]()
    for step in steps:
        own = [n for n in step["effects"] if n in left]
        for name in own:
            del left[name]
        groups += [own] if step["verdict"] == "ambiguous" else [[n] for n in own]
    return [g for g in (*groups, *([n] for n in left)) if g]
