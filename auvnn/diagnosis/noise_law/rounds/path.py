"""Where a search together with a stochastic force has come."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from auvnn.answer_types import SearchStep
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.noise_law.hypothesis import GROUP, Hypothesis, explains_an_axis
from auvnn.diagnosis.selection.rivals import without_lost


@dataclass
class Path:
    """Where a search has come.

    Attributes:
        current: the explanation with what was found.
        chosen: names found so far.
        steps: of the search.
        groups: explanations between which the log cannot decide.
        dropped: names that later ones made needless, or that gave their place to a rival; they are not asked for again.
        needless: those of them that later ones made needless; they may still take the place of another name.
        not_named: explanations with one name more that were not named.
        stands_out: see `WithForce`.
        explains: see `WithForce`.
        null: the explanation without any name, where it was the beginning.
    """

    current: Hypothesis
    chosen: list[str] = field(default_factory=list)
    steps: list[SearchStep] = field(default_factory=list)
    groups: list[list[FittedHypothesis]] = field(default_factory=list)
    dropped: list[str] = field(default_factory=list)
    not_named: list[Hypothesis] = field(default_factory=list)
    stands_out: bool = False
    explains: bool = False
    null: Hypothesis | None = None
    needless: list[str] = field(default_factory=list)

    @classmethod
    def of_names(cls, named: Hypothesis, steps: Sequence[SearchStep]) -> Path:
        """Return a path to names that another search has found, each a step.

        Args:
            named: the explanation with them.
            steps: of that search.
        """
        names = list(named.explanation.effects)
        p_values = {n: s["p_value"] for s in steps for n in s["effects"] if s["verdict"] != "withdrawn"}
        told: list[SearchStep] = [
            {"verdict": "named", "effects": [n], "p_value": p_values.get(n, 1.0)} for n in names
        ]
        return cls(named, names, told)

    def without(self, name: str, current: Hypothesis) -> None:
        """Go on without a name.

        Args:
            name: that is needed no longer.
            current: the explanation without it.
        """
        if name == self.chosen[0]:
            null = self.null
            self.stands_out = False
            self.explains = self.explains and null is not None and explains_an_axis(current, null)
        self.current, self.not_named = current, []
        self.dropped.append(name)
        self.needless.append(name)
        self.chosen = [c for c in self.chosen if c != name]
        self.steps = [s for s in self.steps if s["effects"][0] != name]
        self.groups = [g for g in self.groups if g[0].effects[-1] != name]

    def exchange(self, name: str, other: Hypothesis, *, tied: bool) -> None:
        """Go on with a rival in the place of a name.

        Args:
            name: whose place the rival takes.
            other: the explanation with the rival, which came last, in its place.
            tied: whether the log cannot tell the two apart.
        """
        before = with_last(self.current, name)
        known = next((g[1:] for g in self.groups if g[0].effects[-1] == name), [])
        members = [e for e in known if e.effects[-1] != other.name]
        self.groups = [g for g in self.groups if g[0].effects[-1] != name]
        # What could not be told from the name has not lost against the rival.
        group = [other.explanation, *([before] if tied else []), *members][:GROUP]
        self.groups += [group] if len(group) > 1 else []
        self._step(name, [e.effects[-1] for e in group])
        self.chosen = [other.name if c == name else c for c in self.chosen]
        self.dropped.append(name)
        self.needless = [n for n in self.needless if n != other.name]
        self.current, self.not_named = other, []

    def tie(self, name: str, other: Hypothesis) -> None:
        """Say of a rival that the log cannot tell it from a name.

        Args:
            name: that leads.
            other: the explanation with the rival, which came last, in its place.
        """
        group = next((g for g in self.groups if g[0].effects[-1] == name), None)
        if group is None:
            group = [with_last(self.current, name)]
            self.groups.append(group)
        group.append(other.explanation)
        self.needless = [n for n in self.needless if n != other.name]
        self._step(name, [e.effects[-1] for e in group])

    @property
    def rivals(self) -> list[str]:
        """The effects that the log cannot tell from names."""
        return [e.effects[-1] for g in self.groups for e in g[1:]]

    @property
    def tied(self) -> dict[str, list[FittedHypothesis]]:
        """By the name that leads a group, the explanations with each of the others in its place."""
        return {g[0].effects[-1]: g[1:] for g in self.groups}

    def take_apart(self, rival: str) -> None:
        """Say of an effect that could not be told from a name that it is no rival: the log needs it beside the name.

        Args:
            rival: the effect; nothing changes where it is none.
        """
        lost = {(g[0].effects[-1], rival) for g in self.groups}
        self.steps, self.groups = without_lost(self.steps, self.groups, lost)

    def members(self, name: str) -> int:
        """Return how many effects, the name among them, the log cannot tell from a name.

        Args:
            name: that leads.
        """
        return next((len(g) for g in self.groups if g[0].effects[-1] == name), 1)

    @property
    def in_order(self) -> list[list[FittedHypothesis]]:
        """The groups in the order of the steps that they belong to."""
        at = {s["effects"][0]: k for k, s in enumerate(self.steps)}
        return sorted(self.groups, key=lambda g: at[g[0].effects[-1]])

    def _step(self, name: str, names: list[str]) -> None:
        """Put names in the place of those of the step that a name leads."""
        at = next(k for k, s in enumerate(self.steps) if s["effects"][0] == name)
        verdict = "ambiguous" if len(names) > 1 else "named"
        self.steps[at] = {**self.steps[at], "verdict": verdict, "effects": names}


def with_last(current: Hypothesis, name: str) -> FittedHypothesis:
    """Return the same explanation, one of its effects last.

    Args:
        current: the explanation.
        name: of the effect.
    """
    effects = (*[e for e in current.explanation.effects if e != name], name)
    return replace(current.explanation, effects=effects)
