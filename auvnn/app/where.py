"""What the screen "where it fails" shows of a comparison: traces, the map of the residual, and its samples."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from auvnn.app.logview import run_of
from auvnn.app.traces import intervals, part, thin
from auvnn.comparison.locate import AXES, WORDS, members
from auvnn.errors import ConfigError, InputError
from auvnn.logs import Log
from auvnn.metrics.rollouts import NAMES

SERIES = ("measured", "model", "residual")


class Where:
    """One comparison, read back from its folder.

    Args:
        folder: `comparison.json`, `more.json` and `predictions.parquet`.
        log: that was compared.
    """

    def __init__(self, folder: Path, log: Log) -> None:
        import polars as pl

        self.log = log
        self.answer: dict[str, Any] = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
        self.more: dict[str, Any] = json.loads((folder / "more.json").read_text(encoding="utf-8"))
        table = pl.read_parquet(folder / "predictions.parquet")
        self._runs: dict[int, dict[str, np.ndarray]] = {}
        for run in log.runs:
            rows = table.filter(pl.col("run") == run.number)
            self._runs[run.number] = {name: rows[name].cast(pl.Float64).to_numpy() for name in rows.columns}

    def traces(
        self, number: int | None, low: float | None, high: float | None, points: int
    ) -> dict[str, Any]:
        """Return measured and predicted velocities and the residual wrench of a run between two times, thinned.

        Args:
            number: of the run; the first one where None.
            low: begin, s; from the run's start where None.
            high: end, s; to its end where None.
            points: most points of each trace.
        """
        run = run_of(self.log, number)
        columns = self._runs[run.number]
        t = columns["t"]
        piece = part(t, low, high)
        series = {}
        for name, axis in zip(NAMES, AXES, strict=True):
            series[name] = columns[name][piece]
            series[f"{name}_model"] = columns[f"{name}_model"][piece]
            series[axis] = columns[f"{axis}_residual"][piece]
        return thin(t[piece], series, points)

    def map(self) -> dict[str, Any]:
        """Return the root mean square of the residual by degree of freedom and regime, and its noise floor."""
        regimes = {
            name: {**{k: place[k] for k in ("edges", "unit", "count")}, "rms": place["rms"]}
            for name, place in self.more["regimes"].items()
        }
        floor = dict(zip(AXES, self.more["wrench_floor"], strict=True))
        return {"regimes": regimes, "floor": floor, "axes": list(AXES), "words": WORDS}

    def marks(self, regime: str, number: int) -> dict[str, Any]:
        """Return where the samples of one bin of one regime lie: by run, stretches in s.

        Raises:
            ConfigError: no such regime or bin.
        """
        places = self.more["regimes"]
        if regime not in places or not 0 <= number < len(places[regime]["edges"]) - 1:
            raise ConfigError(f"no bin {number} of '{regime}'; there are: {', '.join(places)}")
        spans = {
            str(run.number): intervals(run.t, members(run, places, regime, number)) for run in self.log.runs
        }
        return {"runs": spans, "count": places[regime]["count"][number]}


def held_out_traces(
    folder: Path, number: int | None, low: float | None, high: float | None, points: int
) -> dict[str, Any]:
    """Return the held-out traces of an improvement: measured, before, refitted and after, thinned.

    Args:
        folder: of an improvement, with `series.npz` in it.
        number: of the run; the first held-out one where None.
        low: begin, s; from the run's start where None.
        high: end, s; to its end where None.
        points: most points of each trace.

    Raises:
        InputError: the answer has no such run.
    """
    with np.load(folder / "series.npz", allow_pickle=False) as arrays:
        runs = sorted({int(key.split(":")[0]) for key in arrays.files})
        if not runs or (number is not None and number not in runs):
            raise InputError(f"no run {number} was held out; there are: {runs}")
        chosen = runs[0] if number is None else number
        t = arrays[f"{chosen}:t"]
        piece = part(t, low, high)
        series = {}
        for key, suffix in (
            ("measured", ""),
            ("before", "_before"),
            ("refitted", "_refitted"),
            ("after", "_after"),
        ):
            values = arrays[f"{chosen}:{key}"][piece]
            series.update({f"{name}{suffix}": values[:, k] for k, name in enumerate(NAMES)})
    return {**thin(t[piece], series, points), "runs": runs, "run": chosen}
