"""Entries of `benchmark.json` as type checkers see them; when the program runs they are plain dictionaries."""

from __future__ import annotations

from typing import TypedDict


class RateEntry(TypedDict):
    """A rate with its 95 % interval; `share` is None where there is nothing to count, `hits` of means and medians."""

    rate: str
    hits: int | None
    count: int
    share: float | None
    low: float | None
    high: float | None


class PartRate(RateEntry):
    """The rate of one part of the plan, or of "all"."""

    part: str


class TargetEntry(PartRate):
    """What was aimed at and what came out; `met` is None where nothing was counted."""

    least: float | None
    most: float | None
    met: bool | None


class SmallestFound(TypedDict):
    """The size at which an effect is found with a chance of 90 %, its 95 % interval, and words where there is none."""

    size: float | None
    low: float | None
    high: float | None
    determined: bool
    logs: int
    words: str
