"""Rows where a recording holds together: where stamps run backwards, a new stretch begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.readers.base import Table
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.recordings import rates
from auvnn.logs.reading.recordings.rates import Series
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.recording import Recording

if TYPE_CHECKING:
    pass

Array = NDArray[np.float64]


_BACK = 1.0  # s; a clock that goes back further was set


def _merged(series: list[Series], recording: Recording, plan: Mapping, where: str, result: Table) -> None:
    """Merge the series part by part, a part being what lies between two restarts of the clock."""
    rows = rates.rows_of(series, plan.rows, where)
    steps = {s.topic: s.step for s in series if len(s.t) > 1}
    pieces: list[dict[str, Array]] = []
    parts = _parts(series, rows, recording.parts, where, result)
    alone = len(parts) == 1 and plan.run is None
    topic = rows.topic
    del rows  # with the list that `merge` empties, nothing else holds what it has done
    for number, part in enumerate(parts):
        mine = rates.rows_of(part, plan.rows, where) if any(len(s.t) for s in part) else None
        if mine is None or len(mine.t) < 2:
            continue
        columns, notes = rates.merge(part, mine, where, plan.commands.between, plan.commands.longest)
        if not alone:
            columns.setdefault("run", np.full(len(columns["t"]), float(number + 1)))
        pieces.append(columns)
        result.repairs += [n for n in notes if n.what not in {r.what for r in result.repairs}]
    if not pieces:
        raise InputError(f"{where}: the topics of the mapping hold no two samples with a time")
    if len(pieces) == 1:
        result.columns |= pieces[0]
        if plan.run is None:
            result.columns.pop("run", None)
    else:
        for name in dict.fromkeys(n for p in pieces for n in p):
            result.columns[name] = np.concatenate([p.get(name, np.full(len(p["t"]), np.nan)) for p in pieces])
    result.rows = len(result.columns["t"])
    if len(steps) > 1:
        told = ", ".join(f"{n} {1 / s:.3g} Hz" for n, s in steps.items() if np.isfinite(s))
        words = f"sensors of several rates brought to the times of {topic}: {told}"
        result.repairs.append(Repair(words, where, len(steps), "info"))


def _parts(
    series: list[Series], rows: Series, cuts: tuple[float, ...], where: str, result: Table
) -> list[list[Series]]:
    back = np.flatnonzero(np.diff(rows.t) < -_BACK) + 1 if len(rows.t) > 1 else np.zeros(0, int)
    if not len(back) and not cuts:
        return [series]
    if len(back):
        words = "times at which the clock was set back: split there into further runs"
        result.repairs.append(Repair(words, where, len(back), "warning"))
    parts: list[list[Series]] = [[] for _ in range(len(back) + len(cuts) + 1)]
    for one in series:
        if (
            len(back)
            and rows.arrival is not None
            and one.arrival is not None
            and len(one.arrival) == len(one.t)
        ):
            index = np.searchsorted(rows.arrival[back], one.arrival, side="right")
        elif len(back):
            own = (
                np.cumsum(np.concatenate([[0], np.diff(one.t) < -_BACK])) if len(one.t) else np.zeros(0, int)
            )
            index = np.minimum(own, len(back))
        else:
            index = np.searchsorted(np.array(cuts), one.t, side="right")
        for k in range(len(parts)):
            parts[k].append(one.cut(index == k))
    return parts
