"""The answer of a diagnosis: `diagnosis.json` of the public contract, and what its report shows besides."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answer_types import (
    Candidate,
    DerivativeEntry,
    EffectCost,
    MovedCoefficient,
    NextExperiment,
    RefittedCoefficients,
    SearchStep,
)
from auvnn.answers import PLOTTED, Answer
from auvnn.cards import Card, figure, measured
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.training.confounding.confounding import Confounding

Array = NDArray[np.float64]


class Names(list[str]):
    """Names for `add`.

    Attributes:
        refit: whether some are of effects that the model has, at values that the log contradicts: `add` fits them anew.
    """

    refit: bool = False


class OneOf(Names):
    """Names of which one is missing, and the log cannot tell which; `add` takes the first of them."""


@dataclass(kw_only=True, repr=False)
class Diagnosis(Answer):
    """What is missing in a model; `to_dict` is `diagnosis.json` of the public contract.

    Attributes:
        verdict: named, ambiguous, partial, unknown or adequate.
        missing: names to add, those that matter first; of an ambiguous verdict the rivals, as `OneOf`.
        unsure: names beside which all else is told, though they are not known to improve predictions; not in `missing`.
        stated: of the names that are told, such as the model has already, with the values that it states.
        matters: name to what it costs, how large its force is, and whether that is beyond the tolerance.
        nearest: names that explain a part and are not the cause; of a partial verdict those that predict.
        joint: of a partial verdict, what each of these does in addition to the others.
        left: degree of freedom to the force without a name, and the smallest that this log would have shown.
        small_remainder: whether a force is left that does not matter.
        moved: stated coefficients that were moved by more than two of their standard deviations.
        refitted: what refitting the stated coefficients brings beside the names; None where that does not matter.
        tolerance: what does not matter.
        judged_by: how the costs were worked out.
        baseline: error of the model as given, of a plain regression and of persistence, and where it loses to them.
        inseparable: degree of freedom to groups of inputs in `depends_on` that the log cannot tell from one another.
    """

    kind = "diagnosis"
    model: str
    log: str
    verdict: str
    missing: list[str]
    steps: list[SearchStep]
    candidates: list[Candidate]
    unexplained: float
    depends_on: dict[str, dict[str, float]]
    next_experiment: NextExperiment | None
    warnings: list[str]
    derivative: DerivativeEntry
    global_p_value: float
    similarity: tuple[list[str], Array] = field(default_factory=lambda: ([], np.eye(0)))
    explanation: FittedHypothesis | None = None
    residual_tests: dict[str, Any] = field(default_factory=dict)
    absorbed: Confounding | None = None
    acts_in: dict[str, float] = field(default_factory=dict)
    nearest: list[str] = field(default_factory=list)
    matters: dict[str, EffectCost] = field(default_factory=dict)
    joint: dict[str, dict[str, Any]] = field(default_factory=dict)
    left: dict[str, Any] = field(default_factory=dict)
    small_remainder: bool = False
    moved: list[MovedCoefficient] = field(default_factory=list)
    tolerance: dict[str, float] = field(default_factory=dict)
    judged_by: str = ""
    whole_log: dict[str, Any] | None = None
    baseline: dict[str, Any] = field(default_factory=dict)
    stochastic: dict[str, Any] = field(default_factory=dict)
    inseparable: dict[str, list[list[str]]] = field(default_factory=dict)
    stated: dict[str, dict[str, float]] = field(default_factory=dict)
    unsure: list[str] = field(default_factory=list)
    refitted: RefittedCoefficients | None = None

    @property
    def surfaces(self) -> list[dict[str, Any]]:
        """The learned damping by degree of freedom, and the range that the log covered; empty without any."""
        return [] if self.absorbed is None else self.absorbed.surfaces

    def card(self) -> Card:
        """Return the verdict, and the leading candidates with their values."""
        named = [*self.missing, *(n for n in self.nearest if n not in self.missing)]
        leading = [c for c in self.candidates if c["effect"] in named]
        rows = []
        for c in leading or self.candidates[:5]:
            fitted = [
                f"{n} {measured(p['value'], p['std'], p['unit'])[0]}" for n, p in c["parameters"].items()
            ]
            rows.append(
                [c["effect"], figure(c.get("p_value"), 2), figure(c.get("explained"), 2), "; ".join(fitted)]
            )
        return Card(
            f"Diagnosis of {self.model} with {self.log}",
            ": ".join(v for v in (self.verdict, ", ".join(named)) if v),
            self.story[:3],
            ("candidate", "p", "explained share", "value ± one standard deviation"),
            rows,
            f".missing goes into auvnn.add; {PLOTTED}",
        )

    @property
    def story(self) -> list[str]:
        """The answer as a few plain sentences."""
        from auvnn.diagnosis.answers.words import tell

        return tell(self)

    @property
    def judged_words(self) -> list[str]:
        """What each name costs and what is left, as plain sentences."""
        from auvnn.diagnosis.answers import judged_words
        from auvnn.diagnosis.answers.moved_coefficients import moved_words
        from auvnn.diagnosis.answers.refitted_coefficients import refitted_words

        told = judged_words.predicts(self) if self.verdict == "partial" else judged_words.costs(self)
        if self.refitted is None:
            return [*told, *judged_words.left(self), *moved_words(self.moved)]
        off = refitted_words(self.refitted, None if self.verdict == "adequate" else self.matters)
        return [*told, *off, *judged_words.left(self)]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        from auvnn.answers import plain

        names = (
            "model",
            "log",
            "derivative",
            "verdict",
            "missing",
            "stated",
            "unsure",
            "steps",
            "candidates",
            "unexplained",
            "depends_on",
            "inseparable",
            "acts_in",
            "nearest",
            "matters",
            "joint",
            "left",
            "small_remainder",
            "moved",
            "refitted",
            "tolerance",
            "judged_by",
            "judged_words",
            "next_experiment",
            "warnings",
            "global_p_value",
            "residual_tests",
            "story",
            "whole_log",
            "baseline",
            "stochastic",
        )
        absorbed = None if self.absorbed is None else self.absorbed.to_dict()
        return plain(
            {"schema": "auvnn/diagnosis/1", **{n: getattr(self, n) for n in names}, "absorbed": absorbed}
        )
