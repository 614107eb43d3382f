"""Adaptation while running, and what kind of change was seen."""

from __future__ import annotations

from auvnn.online.adapter import Adapter, Counts, Update
from auvnn.online.frozen import FrozenErrors, frozen_errors
from auvnn.online.guards import Guards

__all__ = ["Adapter", "Counts", "FrozenErrors", "Guards", "Update", "frozen_errors"]
