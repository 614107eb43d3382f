"""The whole loop: check, compare, diagnose, add what improves the model until nothing does, learn the rest, the budget.

Names of causes come from the diagnosis. What it cannot name is looked for by prediction: the catalogue, linearised, then
drag of every coupling, then a force of what was measured. Every step, whoever proposed it, is fitted and accepted by one
figure: free running on what was left out of `log` improves by more than its own standard error. `test` chooses nothing.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from auvnn.diagnosis.hypotheses.candidates import candidates_for
from auvnn.errors import ConfigError
from auvnn.improvement.loop import learned, networks
from auvnn.improvement.loop.answer import LEARNED, PREDICTS, REFITTED, Improved
from auvnn.improvement.loop.budget import budget
from auvnn.improvement.loop.causes import Causes
from auvnn.improvement.loop.screen import PROMISE, Promise, promises, wanted
from auvnn.improvement.loop.state import State, fitted
from auvnn.improvement.loop.trials import FAILURES
from auvnn.logs import Log
from auvnn.logs.leakage import leakage
from auvnn.models.load_arguments import GivenLog, GivenModel, as_log, as_model
from auvnn.threads import on_one_thread

# Names that are fitted in one round of the search by prediction; how many of them may fail before it ends.
FITTED = 3


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
    """Run the loop until nothing improves the model, and return the model, its history and the error budget.

    Args:
        model: as known; it is not changed.
        log: measurements; everything is chosen and fitted here, by leaving parts of it out in turn.
        test: what the budget is judged on, once, at the end; by default the last run of `log`, or the last 30 % of a
            single one, which is then not fitted.
        effects: names that may be added; the whole catalogue by default.
        learn: what may be learned where names end: "polynomial" (drag of every coupling), "mlp" (damping
            subnetworks), "residual_force".
        max_effects: add at most this many names.
        seconds: start nothing new after this time; what has been accepted by then is kept.
        diagnosing: ask the diagnosis for causes; without it names are looked for by prediction alone.
        derivative: how accelerations are obtained where they were not measured.
        force: go on with a log that contradicts itself: signs, units, axes.
        progress: called with what is being done, in words.
        tell: called with each sentence of the story as it happens.

    Raises:
        ConfigError: an unknown effect, or unknown kind of what may be learned.
        InputError: the same data on both sides, a log that contradicts itself, or one that is too short.

    Example:
        ```python
        model = auvnn.load("rov95")
        log = auvnn.simulate(model, noise="realistic", hidden=["ocean_current", "net_buoyancy"]).log
        better = auvnn.improve(model, log, seconds=120.0)
        better.story  # what was done and found, sentence by sentence
        better.model.save("better-model")
        ```
    """
    log = as_log(log)
    model = as_model(model, log)
    test = None if test is None else as_log(test, "test")
    strange = [k for k in learn if k not in learned.KINDS]
    if strange:
        raise ConfigError(f"learn={strange[0]}: choose from {', '.join(learned.KINDS)}")
    held_out = f"{test.name} is held out" if test is not None else ""
    for part in (log, test):
        if part is not None:
            part.refuse_unmeasured()
    if model.vehicle.reduced or model.vehicle.glides:
        raise ConfigError(f"{model.vehicle.name} is a reduced model: take compare, diagnose and add for it")
    if test is None:
        log, test, held_out = log.split()
    else:
        leakage(log, test)
        test.quality().refuse_contradictions(force)
    log.quality().refuse_contradictions(force)
    names = None if effects is None else candidates_for(model, log, effects, stated=True)[0]
    walk = Walk(model, log, derivative, names, max_effects, seconds, progress, tell)
    walk.check()
    walk.commands()
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


class Walk(Causes):
    """One walk around the loop.

    Attributes:
        state: the model that has been accepted so far.
        steps: what was taken.
        tried: what was tried and not taken.
        story: what was done and found.
        adequate: the diagnosis found nothing (more) that is missing.
    """

    def predict(self) -> None:
        """Look for names that predict better, whatever they stand for, until none pays."""
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
            self.say("looking through the catalogue for what predicts better")
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
                    self._note(other, p.effect, PREDICTS, False, f"{best.effect} predicts better")
            reason = "came near in the diagnosis" if best.effect in near else "promised most of the catalogue"
            if not self._take(state, best.effect, PREDICTS, reason):
                return

    def learn(self, kind: str) -> None:
        """Learn what has no name, if it pays."""
        if self.late():
            return
        if kind == networks.FORM:
            self._networks()
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
                    state, name, LEARNED, False, f"of {other.words}; of {choice.words} it predicts better"
                )
        held = choice.recipe.ridge[name]
        self._take(best, name, LEARNED, f"of {choice.words}, held within {held:g} of its scale")

    def _networks(self) -> None:
        """Train damping subnetworks, with the coefficients as they are and fitted again with them, if that pays."""
        if self.model.damping is not None or len(self.judge.folds.numbers) < 3:
            return
        begin = self._before() or self.state
        state = self._try(
            lambda: networks.trained(self.model, self.judge, begin, self.how), "training damping subnetworks"
        )
        if state is None:
            return
        again = None
        if not self.late():
            again = self._try(
                lambda: fitted(self.model, self.judge, state.recipe, state, steps=4),
                "fitting the coefficients together with the subnetworks",
            )
        best = min((s for s in (state, again) if s is not None), key=lambda s: s.left.total)
        self._take(best, networks.FORM, LEARNED, "damping subnetworks, trained one step ahead")

    def polish(self) -> None:
        """Fit what has been taken over other lengths of windows, and keep what predicts best."""
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
                    f"in {', '.join(found['loses'][other])} the model is worse than {words} on {test.name}"
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


__all__ = ["Improved", "improve"]
