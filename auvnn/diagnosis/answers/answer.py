"""The answer of a diagnosis: `diagnosis.json` of the public contract, and what its report shows besides."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answers import Answer
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.training.confounding.confounded_effects import Confounding

Array = NDArray[np.float64]


@dataclass
class Diagnosis(Answer):
    """What is missing in a model; `to_dict` is `diagnosis.json` of the public contract."""

    kind = "diagnosis"
    model: str
    log: str
    verdict: str
    missing: list[str]
    steps: list[dict[str, Any]]
    candidates: list[dict[str, Any]]
    unexplained: float
    depends_on: dict[str, dict[str, float]]
    next_experiment: dict[str, Any] | None
    warnings: list[str]
    derivative: dict[str, Any]
    global_p_value: float
    similarity: tuple[list[str], Array] = field(default_factory=lambda: ([], np.eye(0)))
    explanation: FittedHypothesis | None = None
    residual_tests: dict[str, Any] = field(default_factory=dict)
    absorbed: Confounding | None = None
    acts_in: dict[str, float] = field(default_factory=dict)
    nearest: list[str] = field(default_factory=list)
    whole_log: dict[str, Any] | None = None
    left: dict[str, dict[str, float]] = field(default_factory=dict)
    commands: dict[str, Any] | None = None

    @property
    def surfaces(self) -> list[dict[str, Any]]:
        """The learned damping by degree of freedom, and the range that the log covered; empty without any."""
        return [] if self.absorbed is None else self.absorbed.surfaces

    @property
    def story(self) -> list[str]:
        """The answer as a few plain sentences."""
        from auvnn.diagnosis.answers.words import tell

        return tell(self)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        from auvnn.answers import plain

        names = (
            "model",
            "log",
            "derivative",
            "verdict",
            "missing",
            "steps",
            "candidates",
            "unexplained",
            "depends_on",
            "acts_in",
            "nearest",
            "next_experiment",
            "warnings",
            "global_p_value",
            "residual_tests",
            "story",
            "whole_log",
            "left",
            "commands",
        )
        absorbed = None if self.absorbed is None else self.absorbed.to_dict()
        return plain(
            {"schema": "auvnn/diagnosis/1", **{n: getattr(self, n) for n in names}, "absorbed": absorbed}
        )
