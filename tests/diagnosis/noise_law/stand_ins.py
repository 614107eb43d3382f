"""Explanations that say no more than their names and what they are worth."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


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
