"""Explanations that say no more than their names and what they are worth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np

from auvnn.diagnosis.answers.tolerance import Tolerance
from auvnn.diagnosis.noise_law.rounds.names_given import NamesGiven
from auvnn.metrics.force_law import ForceLaw


def one_by_one(refit: Any) -> Any:
    """Return what fits several changes, from what fits one."""
    return lambda changes: [refit(*change) for change in changes]


def worth(evidence: float) -> Any:
    return SimpleNamespace(evidence=evidence)


def explanation(*effects: str) -> Any:
    return SimpleNamespace(effects=effects)


def fit(evidence: float, *effects: str) -> Any:
    return SimpleNamespace(evidence=evidence, name=effects[-1], explanation=explanation(*effects))


NULL = fit(-1000.0, "")


def hypothesis(name, misfit, evidence=None) -> Any:
    """Return as much of a hypothesis as a comparison looks at."""
    return SimpleNamespace(
        name=name,
        misfit=misfit,
        evidence=-0.5 * misfit if evidence is None else evidence,
        explanation=SimpleNamespace(effects=(name,) if name else ()),
    )


def with_law(rms, evidence=0.0, name="", time=1.0) -> Any:
    law = ForceLaw(np.array([*rms, 0.0, 0.0, 0.0, 0.0]), np.full(6, time), 0.5, 5.0)
    return SimpleNamespace(
        name=name, evidence=evidence, misfit=-2.0 * evidence, estimate=SimpleNamespace(law=law)
    )


def given(**changes: Any) -> NamesGiven:
    """Return what decides which of the likely explanations cost enough."""
    at: dict[str, Any] = {"layout": None, "log": None, "scale": None, "tolerance": Tolerance(), **changes}
    return NamesGiven(**at)
