"""The answer of `add`: `improvement.json` of the public contract."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from auvnn.answer_types import ByEffect, OwnFall, WaterfallStep
from auvnn.answers import PLOTTED, Answer, plain
from auvnn.cards import PARAMETER_HEAD, Card, figure, not_needed, parameter_rows, still_beaten
from auvnn.comparison.predictions import RefittedTraces
from auvnn.models import GreyBox


@dataclass(kw_only=True, repr=False)
class Improvement(Answer):
    """What adding effects did; `to_dict` is `improvement.json` of the public contract.

    Attributes:
        model: name of the model before.
        accepted: whether the held-out error fell by more than its own uncertainty, and each effect, added to the others,
            lowers the error by more than the uncertainty of that fall.
        by_effect: effect to the fall of the held-out error that it adds to that of the others, everything else refitted,
            whether that is beyond its uncertainty, and what else to mind of it.
        baseline: what a plain regression and holding the initial velocity reach on the held-out data.
        better: the model with the effects.
        commands: how they go between the log's samples, as the model states it then; None where they are held.
        refitted_model: the model as given, its uncertain coefficients refitted.
        left_out: where one-step errors were fitted, their weighted size on runs of `log` left out in turn: before
            and after, the fall and its standard error; None otherwise. It never saw the test log.
        steps: the models of the waterfall one by one: their held-out figures, and what `left_out` is from each to
            the next, by "run" and by "fifth" of every run.
    """

    kind = "improvement"
    name: str
    log: str
    test: str
    effects: list[str]
    accepted: bool
    before: dict[str, Any]
    refitted: dict[str, Any]
    after: dict[str, Any]
    gain: dict[str, float]
    waterfall: list[WaterfallStep]
    parameters: ByEffect
    coefficients: ByEffect
    held_out: str
    model: GreyBox
    refitted_model: GreyBox
    warnings: list[str] = field(default_factory=list)
    series: list[RefittedTraces] = field(default_factory=list)
    objective: str = "rollout"
    left_out: dict[str, float] | None = None
    steps: list[dict[str, Any]] = field(default_factory=list)
    by_effect: dict[str, OwnFall] = field(default_factory=dict)
    baseline: dict[str, Any] = field(default_factory=dict)
    commands: dict[str, Any] | None = None

    def card(self) -> Card:
        """Return the fall of the held-out error, and the fitted values."""
        steps = [f"{w['step']} {figure(w['error'])}" for w in self.waterfall]
        verdict = "accepted" if self.accepted else "not accepted"
        fall = f"the held-out error falls by {figure(self.gain['value'])} ± {figure(self.gain['std'], 2)}"
        more = (not_needed(self.gain, self.by_effect), still_beaten(self.baseline))
        fall = "; ".join(x for x in (fall, *more) if x)
        return Card(
            f"Improvement of {self.name} by {', '.join(self.effects)}",
            f"{verdict}: {fall}",
            [f"Error of free running on {self.test}: {', '.join(steps)}.", *self.warnings[:2]],
            PARAMETER_HEAD,
            parameter_rows(self.parameters),
            f".model is the model with it; {PLOTTED}",
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "log",
            "test",
            "effects",
            "accepted",
            "before",
            "refitted",
            "after",
            "gain",
            "waterfall",
            "parameters",
            "coefficients",
            "held_out",
            "objective",
            "left_out",
            "by_effect",
            "baseline",
            "commands",
            "warnings",
        )
        return plain(
            {"schema": "auvnn/improvement/1", "model": self.name, **{n: getattr(self, n) for n in names}}
        )
