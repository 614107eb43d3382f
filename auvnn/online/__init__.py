"""Adaptation while running, and what kind of change was seen.

`adapt` takes a log sample by sample through an `adapter`, which is made of `adapter_parts`. Each sample passes
`intake`, `guards`, `consistency` and the `noise` gate, becomes a `residual` wrench, and one of the `schemes` proposes
weights; `updates` bounds, judges and reverts them. `change_detection` says which effect has changed, `state` keeps an
adapter on disk, and `frozen` judges what was learned by free running.
"""

from __future__ import annotations

from auvnn.online.adapt import Adaptation, adapt
from auvnn.online.adapter import Adapter
from auvnn.online.change_detection.change_words import Change
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
