"""What walking the loop led to: `improve.json` of the public contract, the model, and every step on the way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from auvnn.answer_types import WaterfallStep
from auvnn.answers import PLOTTED, Answer, plain
from auvnn.cards import Card, figure
from auvnn.comparison.predictions import BeforeAfterTraces
from auvnn.models import GreyBox

REFITTED, CAUSE, PREDICTS, LEARNED, LEFT = (
    "coefficients refitted",
    "a cause with a name",
    "a name that only predicts",
    "learned",
    "left",
)


@dataclass
class Step:
    """One step that was taken, or tried and not taken.

    Attributes:
        step: what it is called: "coefficients refitted", or the name of an effect.
        kind: one of the contract's five kinds.
        accepted: whether it paid on what was left out.
        gain: value and standard error of the fall of the error on what was left out, and by degree of freedom.
        before: that error before.
        after: and after.
        how: how the model was fitted, in words.
        parameters: effect to its parameters' values, standard errors and units.
        reason: why it was tried, or why it was not taken.
        model: with everything up to this step.
        uses: degrees of freedom that what was learned uses.
    """

    step: str
    kind: str
    accepted: bool
    gain: dict[str, Any]
    before: float
    after: float
    how: str
    parameters: dict[str, Any] = field(default_factory=dict)
    reason: str = ""
    model: GreyBox | None = None
    uses: dict[str, Any] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data."""
        names = ("step", "kind", "accepted", "gain", "before", "after", "how", "parameters", "reason", "uses")
        return {n: getattr(self, n) for n in names}


@dataclass(repr=False)
class Improved(Answer):
    """The whole loop on a log; `to_dict` is `improve.json` of the public contract.

    Attributes:
        name: of the model.
        log: what everything was chosen by and fitted to.
        test: what was judged on once, at the end.
        held_out: which data that were, in words.
        steps: what was taken, in order.
        tried: what was tried and not taken.
        waterfall: error on `test` after each step: step, kind, error, and its error on what was left out of `log`.
        baseline: error of the plain regression on `test`, in total and by velocity, and that of persistence.
        before: free running of the model as given on `test`.
        after: the same of the model at the end.
        loses: velocities in which the model at the end is worse than the regression or persistence.
        diagnoses: what was diagnosed on the way.
        story: what was done and found, in plain words.
        warnings: in plain words.
        objective: what was fitted at the end.
        folds: what was left out in turn, in words.
        horizon: of free running, s.
        seconds: that it took.
        stopped: why it ended.
        model: at the end.
        given: as it was given.
        series: of the test log, for figures.
    """

    kind = "improve"
    name: str
    log: str
    test: str
    held_out: str
    steps: list[Step]
    tried: list[Step]
    waterfall: list[WaterfallStep]
    baseline: dict[str, Any]
    before: dict[str, Any]
    after: dict[str, Any]
    loses: dict[str, list[str]]
    diagnoses: list[dict[str, Any]]
    story: list[str]
    warnings: list[str]
    objective: dict[str, Any]
    folds: str
    horizon: str
    seconds: float
    stopped: str
    model: GreyBox
    given: GreyBox
    series: list[BeforeAfterTraces] = field(default_factory=list)
    left_out: dict[str, Any] = field(default_factory=dict)

    def card(self) -> Card:
        """Return how far the loop led, and its steps."""
        rows = [[str(w["step"]), str(w.get("kind") or ""), figure(w["error"])] for w in self.waterfall]
        held = f"Judged on {self.test}, once, at the end."
        lost = [
            f"Worse than {what} in {', '.join(names)}." for what, names in (self.loses or {}).items() if names
        ]
        head = ("step", "kind", "held-out error")
        return Card(
            f"Improved {self.name}", self.verdict, [held, *lost], head, rows, f".model, .history(); {PLOTTED}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = (
            "log",
            "test",
            "held_out",
            "waterfall",
            "baseline",
            "before",
            "after",
            "loses",
            "left_out",
            "objective",
            "verdict",
            "folds",
            "horizon",
            "diagnoses",
            "story",
            "warnings",
            "stopped",
            "seconds",
        )
        return plain(
            {
                "schema": "auvnn/improve/1",
                "model": self.name,
                **{n: getattr(self, n) for n in names},
                "steps": [s.to_dict() for s in self.steps],
                "tried": [s.to_dict() for s in self.tried],
                "history": list(self.history()),
            }
        )

    @property
    def verdict(self) -> str:
        """The answer in one sentence."""
        errors = [w["error"] for w in self.waterfall if w["step"] != "noise floor"]
        if not self.steps:
            return f"nothing paid: the model stays as given ({_number(errors[0])} on {self.test})"
        names = ", ".join(s.step for s in self.steps)
        return f"from {_number(errors[0])} to {_number(errors[-1])} on {self.test} by {names}; {self.stopped}"

    def history(self) -> Mapping[str, GreyBox]:
        """Return the model after every step, as given first, by the name of its folder."""
        found = {"00-as-given": self.given}
        for k, step in enumerate(self.steps, start=1):
            if step.model is not None:
                found[f"{k:02d}-{step.step.replace(' ', '-')}"] = step.model
        return found

    def write(self, folder: str | Path, *, report: bool = True) -> Path:
        """Write the answer, the report, the model, and the model after every step under `history/`."""
        folder = Path(folder)
        self.model.save(folder / "model", overwrite=True)
        for name, model in self.history().items():
            model.save(folder / "history" / name, overwrite=True)
        return super().write(folder, report=report)


def _number(value: float | None) -> str:
    return "unknown" if value is None or value != value else f"{value:.3g}"
