"""Adaptation while running, and what kind of change was seen."""

from __future__ import annotations

from auvnn.online.adapt import Adaptation, adapt
from auvnn.online.adapter import Adapter
from auvnn.online.change_words import Change
from auvnn.online.counts import Counts
from auvnn.online.frozen import FrozenErrors, frozen_errors
from auvnn.online.guards import Guards
from auvnn.online.update import Update

__all__ = [
    "Adaptation",
    "Adapter",
    "Change",
    "Counts",
    "FrozenErrors",
    "Guards",
    "Update",
    "adapt",
    "frozen_errors",
]
