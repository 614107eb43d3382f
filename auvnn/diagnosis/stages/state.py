"""What a search is asked, and where it stands: both complete from the start, and never changed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.answers.table import CandidateRow
from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.noise_law.commands.stated import StatedCommands
from auvnn.diagnosis.residuals.additive_force_test import AdditiveForce
from auvnn.diagnosis.residuals.variance_component_test import Unnamed
from auvnn.diagnosis.score_tests.null_tests import NullTests, Tested
from auvnn.diagnosis.score_tests.unexplained import unexplained
from auvnn.diagnosis.selection.choose import Chooser
from auvnn.diagnosis.selection.rivals import without_lost
from auvnn.executors import Executor
from auvnn.executors.serial import SERIAL
from auvnn.logs import Log
from auvnn.metrics.windows import Windows
from auvnn.models import GreyBox
from auvnn.models.actuation.command_path import CommandPath, with_commands

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """What is asked of a log.

    Attributes:
        model: as the user gave it.
        log: measurements.
        layout: the model with everything that is uncertain or asked for, and what was stated of it.
        usable: effects that can be asked for.
        needs: effects that were wanted, and the channels that the log lacks for them.
        base: effects that are free whatever is found.
        floor: (18,) no channel is trusted beyond.
        most: look for at most this many effects.
        tolerance: what does not matter.
        costs: whether to work out what each name costs.
        advice: whether to work out what to drive next, for an ambiguous answer.
        whiteness: whether to test what is left for correlations.
        absorbed: what the learned damping may have taken in that is no damping; None without any.
        notes: what to say about the model and the log besides.
        say: called with what is being done, in words.
        pool: who makes fits of which none has to wait for another.
        driven: the model by whose statement commands go between samples, where the log is not asked for that; else None.
        commands: how they go by the model's statement where the log is asked for it, too; None where it states nothing.
    """

    model: GreyBox
    log: Log
    layout: Layout
    usable: tuple[str, ...]
    needs: Mapping[str, list[str]]
    base: tuple[str, ...]
    floor: Array
    most: int
    tolerance: Tolerance
    costs: bool
    advice: bool
    whiteness: bool
    absorbed: Any
    notes: tuple[str, ...]
    say: Callable[[str], None]
    pool: Executor = SERIAL
    driven: GreyBox | None = None
    commands: StatedCommands | None = None

    @property
    def stated(self) -> dict[str, Array]:
        """The values of the parameters of effects that the model has, by effect."""
        return {n: m for n, m in self.layout.means.items() if n in self.model.effect_names}

    def with_commands(self, path: CommandPath | None) -> Setting:
        """Return the same of models that run free by another statement of how commands go between samples.

        Args:
            path: None for commands that are held.
        """
        layout = replace(self.layout, model=with_commands(self.layout.model, path))
        return replace(self, model=with_commands(self.model, path), layout=layout)

    def chooser(self, windows: Windows) -> Chooser:
        """Return who weighs explanations of these windows."""
        return Chooser(self.layout, windows, self.say, self.pool)

    def tests(self, windows: Windows) -> NullTests:
        """Return who tests effects at their nulls on these windows."""
        return NullTests(self.layout, windows, self.say)


@dataclass(frozen=True)
class State:
    """Where a search stands; every stage returns a new one.

    Attributes:
        windows: of the log, with steps as short as they have turned out to be needed.
        first: the fit of what is uncertain alone.
        current: the fit with what has been found.
        chosen: effects found.
        groups: explanations between which the log cannot decide, each by its last effect; the first of each group
            stands for it in the fit.
        withdrawn: effects that had stood in for something else; they are not asked for again.
        steps: what was found one after the other, as the answer has it.
        table: the candidates, by effect.
        tried: every explanation that was fitted in full, in the order of the search.
        path: the fits with what had been found at the end of each round.
        failed: effects whose fit failed, and why.
        p_value: that nothing is missing at all.
        similar: effects, and how much they look like one another at the first look.
        silent: effects of which the log says nothing.
        ended: whether there is nothing more to ask for.
        interrupted: whether it ended while names could still be asked for, because they left most of a force.
        left: the force that is left once the search has ended; None where there is none.
        traced: the force of a measured input that it looks most like, where that was asked.
        remainder: what any force could still explain, significant or not.
        negligible: whether a force is left that does not matter.
        nearest: names that explain a part of it and are not the cause.
        partial: whether these stay in the fit because they predict.
        refuted: the explanation with names that are no cause, of which it is still open whether they predict.
        unexplained: share of what looked like a force that nothing explains.
        notes: what could not be worked out, in words.
        last_tests: the tests of the effects that remained, with the fit beside which they were made; None where there
            were none.
    """

    windows: Windows
    first: FittedHypothesis
    current: FittedHypothesis
    chosen: tuple[str, ...] = ()
    groups: tuple[tuple[FittedHypothesis, ...], ...] = ()
    withdrawn: tuple[str, ...] = ()
    steps: tuple[SearchStep, ...] = ()
    table: Mapping[str, CandidateRow] = field(default_factory=dict)
    tried: tuple[FittedHypothesis, ...] = ()
    path: tuple[FittedHypothesis, ...] = ()
    failed: Mapping[str, str] = field(default_factory=dict)
    p_value: float = 1.0
    similar: tuple[list[str], Array] = field(default_factory=lambda: ([], np.eye(0)))
    silent: tuple[str, ...] = ()
    ended: bool = False
    interrupted: bool = False
    left: Unnamed | None = None
    traced: AdditiveForce | None = None
    remainder: Unnamed | None = None
    negligible: bool = False
    nearest: tuple[str, ...] = ()
    partial: bool = False
    refuted: FittedHypothesis | None = None
    unexplained: float = 1.0
    notes: tuple[str, ...] = ()
    last_tests: tuple[FittedHypothesis, Tested] | None = None

    def but(self, **changes: Any) -> State:
        """Return the state with some things changed."""
        return replace(self, **changes)

    def step(self, verdict: str, effects: list[str], p_value: float) -> State:
        """Return the state with a further step.

        Args:
            verdict: "named", "ambiguous", "unknown" or "adequate".
            effects: that the step is about.
            p_value: of the step's test.
        """
        return self.but(steps=(*self.steps, {"verdict": verdict, "effects": effects, "p_value": p_value}))

    @property
    def in_groups(self) -> list[str]:
        """The members of all groups between which the log cannot decide."""
        return [e.effects[-1] for group in self.groups for e in group]

    @property
    def leaves_something(self) -> bool:
        """Whether the search ended with something that it has no name for."""
        gone = {e for s in self.steps if s["verdict"] == "withdrawn" for e in s["effects"]}
        standing = [s for s in self.steps if s["verdict"] != "withdrawn" and not {*s["effects"]} <= gone]
        leading = (standing or self.steps[-1:])[0]
        return leading["verdict"] in ("unknown", "partial") or self.steps[-1]["verdict"] == "unknown"

    @property
    def rivals(self) -> list[str]:
        """The effects that the log cannot tell from names, without those that stand for the groups."""
        return [e.effects[-1] for group in self.groups for e in group[1:]]

    def apart(self, rival: str) -> State:
        """Return the state with an effect that could not be told from a name as no rival of it: both are missing.

        Args:
            rival: the effect; the state stays as it is where it is none.
        """
        lost = {(g[0].effects[-1], rival) for g in self.groups}
        steps, groups = without_lost(self.steps, self.groups, lost)
        return self.but(groups=tuple(map(tuple, groups)), steps=tuple(steps))

    def instead(self, name: str, other: str) -> State:
        """Return the state with the step of one effect in the place of another one's, which is no longer given.

        Args:
            name: that is not given any more.
            other: whose step takes its place.
        """
        moved = next(s for s in reversed(self.steps) if other in s["effects"])
        if moved["verdict"] == "named":
            # Of several names that one step gave together the others stay there.
            others = [n for n in moved["effects"] if n != other]
            left = [
                {**s, "effects": others} if s is moved else s for s in self.steps if s is not moved or others
            ]
            moved = {**moved, "effects": [other]}
        else:
            left = [s for s in self.steps if s is not moved]
        return self.but(steps=tuple(moved if s["effects"][:1] == [name] else s for s in left))

    def without_groups(self, names: list[str]) -> tuple[State, list[str]]:
        """Return the state without the groups for which some names stand, and these names with all members."""
        gone = [group for group in self.groups if group[0].effects[-1] in names]
        members = [e.effects[-1] for group in gone for e in group[1:]]
        kept = tuple(group for group in self.groups if not any(group is g for g in gone))
        return self.but(groups=kept), [*names, *members]


@dataclass(frozen=True)
class Searched:
    """A search that has come to its end: what was asked, and where it stood."""

    setting: Setting
    state: State

    @property
    def layout(self) -> Layout:
        """What was stated."""
        return self.setting.layout

    @property
    def usable(self) -> tuple[str, ...]:
        """Effects that could be asked for."""
        return self.setting.usable

    @property
    def base(self) -> tuple[str, ...]:
        """Effects that were free whatever was found."""
        return self.setting.base

    @property
    def floor(self) -> Array:
        """(18,) no channel is trusted beyond."""
        return self.setting.floor

    @property
    def extent(self) -> Any:
        """How far the log reaches, and what the fit without any name leaves of the acceleration."""
        reach = self.setting.tests(self.state.windows).extent
        return replace(reach, left=unexplained(self.state.windows, self.state.first))

    @property
    def first(self) -> FittedHypothesis:
        """The fit of what is uncertain alone."""
        return self.state.first

    @property
    def silent(self) -> tuple[str, ...]:
        """Effects of which the log says nothing."""
        return self.state.silent
