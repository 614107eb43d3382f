"""What the server and its child process send each other, one JSON object a line, as type checkers see it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NotRequired, TypedDict


class LogOrder(TypedDict):
    """What the child needs to read the same log as the page: files, how to read them, and what is held out."""

    files: list[str]
    mapping: dict[str, Any]
    max_duration: float | None
    test: list[str]
    words: str


class Order(TypedDict):
    """A job: its kind and number, and the folder of its answer."""

    kind: str
    job: int
    out: str


class LogJob(Order):
    """A job on a log with a model; `force` goes on with a log that contradicts itself, `seconds` limits the loop."""

    force: bool
    log: LogOrder
    model: str
    seconds: NotRequired[float]


class AddJob(LogJob):
    """A job that adds effects, by name."""

    effects: list[str]


class Example(TypedDict):
    """What came of making the example: the log's file, and the vehicle's name."""

    file: str
    model: str


Summary = Mapping[str, Any]
"""What the page shows of an answer before it reads it: a few of its keys, as they stand in the answer."""


class Report(TypedDict, total=False):
    """What the child says: how a job goes and ends, that one was left out, that a report was drawn, that it ended.

    `done`, `error` and `progress` belong to the job of number `job`; `fault` marks an error of the program.
    """

    job: int
    progress: str
    done: Summary
    error: str
    fault: bool
    left_out: bool
    drawn: str
    problem: str
    ended: int
