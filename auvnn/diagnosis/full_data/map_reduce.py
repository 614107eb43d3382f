"""Passes over all parts of a log: what each worker does with its windows, and how their sums are put together.

Three kinds of pass are enough. Sums of all windows at a point, for a step of a fit or the gradients of tests; second
moments of the windows' scores, for their standard errors; and none keeps anything of a window but its initial state.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import Layout
from auvnn.diagnosis.score_tests.probes import Probed, probed
from auvnn.effects import Extent
from auvnn.estimation.trajectories.initial_states import ROUNDS, fit_initial_states
from auvnn.estimation.window_sums.sufficient_statistics import (
    Combination,
    InformationShares,
    ScoreMoments,
    WindowSums,
    add_parts,
    reduce_windows,
)
from auvnn.executors import Executor
from auvnn.log_chunks.scan import Part, WindowCut
from auvnn.log_chunks.windows import windows_of
from auvnn.metrics.commands.stated import as_stated
from auvnn.progress import Progress

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LinearisationPoint:
    """Where windows are linearised, and towards what.

    Attributes:
        layout: its model holds the parameters at which to stand.
        asked: effects of the layout to be asked for at several shapes.
        extent: how far the log reaches, for those shapes.
        names: effects whose parameters make up the columns; all of the layout's, stand-ins included, by default.
        sigma: (18,) weights' standard deviations; infinite for channels that do not count.
        cut: how windows are cut.
        rounds: steps of each window's initial state before it is linearised.
        combinations: what second moments are wanted of.
    """

    layout: Layout
    asked: tuple[str, ...]
    extent: Extent
    names: tuple[str, ...] | None
    sigma: Array
    cut: WindowCut
    rounds: int = ROUNDS
    combinations: tuple[Combination | InformationShares, ...] = ()

    @cached_property
    def probed(self) -> Probed:
        """The layout with stand-ins in it; made where it is needed, for it cannot be sent."""
        return probed(self.layout, self.asked, self.extent)

    @property
    def columns(self) -> list[str]:
        """Effects in the order of their columns."""
        return list(self.probed.layout.model.effect_names if self.names is None else self.names)


@dataclass(frozen=True)
class PartTask:
    """A part, and where its initial states have come to, (B, 13); None for the measured ones."""

    part: Part
    initial: Array | None = None


def sums_of(point: LinearisationPoint, task: PartTask) -> tuple[WindowSums, Array, Array]:
    """Return a part's sums, its windows' initial states, and those after a further step."""
    statistics, here, then = _reduced(point, task, point.rounds)
    return WindowSums.of(statistics), here, then


def moments_of(point: LinearisationPoint, task: PartTask) -> list[ScoreMoments]:
    """Return the second moments of a part's combinations."""
    statistics, _, _ = _reduced(point, task, 0)
    return [ScoreMoments.of(c.of(statistics), statistics.run) for c in point.combinations]


def _reduced(point: LinearisationPoint, task: PartTask, rounds: int) -> Any:
    torch.set_num_threads(1)
    model = point.probed.layout.model
    # As in the search on some of the windows.
    windows = as_stated(model, windows_of(task.part, point.cut))
    start = None if task.initial is None else torch.as_tensor(task.initial)
    here = (
        fit_initial_states(model, windows, point.sigma, start, rounds) if rounds or start is None else start
    )
    statistics, then = reduce_windows(model, windows, here, point.columns, point.sigma)
    return statistics, here.numpy(), then.numpy()


class MapReduce:
    """Passes over some parts by an executor; keeps each window's initial state between them.

    Args:
        executor: who computes; started.
        parts: in order.
        say: called with what is being done, in words.
    """

    def __init__(
        self, executor: Executor, parts: Sequence[Part], say: Callable[[str], None] = lambda words: None
    ) -> None:
        """Begin at the measured states."""
        self.executor, self.say = executor, say
        self.tasks = [PartTask(p) for p in parts]

    def sums(self, point: LinearisationPoint, words: str, *, moved: bool = False) -> WindowSums:
        """Return the sums of all parts.

        Args:
            point: where.
            words: what is being done.
            moved: keep the initial states after the step that the sums are good for; those before it by default.
        """
        found: list[PartTask] = []

        def each() -> Iterator[WindowSums]:
            for task, (sums, here, then) in zip(self.tasks, self._run(sums_of, point, words), strict=True):
                found.append(PartTask(task.part, then if moved else here))
                yield sums

        total = add_parts(each())
        self.tasks = found
        return total

    def moments(
        self, point: LinearisationPoint, combinations: Sequence[Combination | InformationShares], words: str
    ) -> list[ScoreMoments]:
        """Return the second moments of combinations of all windows' sums.

        Args:
            point: where the windows are linearised.
            combinations: of the columns of the sums.
            words: what is being done, for the progress.
        """
        if not combinations:
            return []
        asked = replace(point, combinations=tuple(combinations))
        total: list[ScoreMoments] | None = None
        for some in self._run(moments_of, asked, words):
            total = some if total is None else [a + b for a, b in zip(total, some, strict=True)]
        assert total is not None  # there is at least one part
        return total

    def _run(
        self, function: Callable[[Any, Any], Any], point: LinearisationPoint, words: str
    ) -> Iterator[Any]:
        for k, answer in enumerate(self.executor.run(function, point, self.tasks), 1):
            self.say(Progress(f"{words}: part {k} of {len(self.tasks)}", k, len(self.tasks)))
            yield answer
