"""What the screen of the log shows: columns as they were read, traces, findings with their places and cures."""

from __future__ import annotations

import weakref
from pathlib import Path
from typing import Any, TypedDict

import numpy as np

from auvnn.app.cures import buttons
from auvnn.app.traces import intervals, part, thin
from auvnn.errors import AuvnnError
from auvnn.logs import Log, Run
from auvnn.logs.channels import is_canonical, unit
from auvnn.logs.quality.quality import Quality
from auvnn.logs.quality.situations import find
from auvnn.logs.readers import choose
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.mapping_file.suggest import likely
from auvnn.logs.signals.segments import default_gap

SPARK = 60
_GAPS: weakref.WeakKeyDictionary[Run, float] = weakref.WeakKeyDictionary()
HEAD = 400
# What a model needs or can use, in the order of the contract.
WANTED = (
    "t", "u", "v", "w", "p", "q", "r", "phi", "theta", "psi", "qw", "qx", "qy", "qz", "x", "y", "z",
    "altitude", "voltage", "tau_X", "tau_Y", "tau_Z", "tau_K", "tau_M", "tau_N",
)  # fmt: skip
GROUPS = {
    "velocity": ("u", "v", "w"),
    "rates": ("p", "q", "r"),
    "attitude": ("phi", "theta", "psi"),
    "position": ("x", "y", "z"),
    "commands": (),
    "fins": (),
    "altitude": ("altitude",),
    "voltage": ("voltage",),
}


class RawColumn(TypedDict):
    """A column of a file under its own name, with a few values; text has none."""

    name: str
    values: list[float | None]
    text: bool


class ColumnView(TypedDict):
    """A canonical column: where it came from, its unit, range, what the mapping does to it, a few values to draw."""

    name: str
    source: str
    unit: str | None
    low: float | None
    high: float | None
    missing: int
    scale: float
    offset: float
    delay: float
    spark: list[float | None]


# A place in time, s: `run`, `from` and `to`, of which one is a keyword.
Mark = TypedDict("Mark", {"run": int, "from": float, "to": float})


def raw_columns(path: Path) -> list[RawColumn]:
    """Return the columns of a file under their own names, with their first values; empty where it cannot be read."""
    try:
        table = choose(path)[0].read_rows(path, 0, HEAD)
    except (AuvnnError, OSError):
        return []
    found: list[RawColumn] = []
    for name in table.names:
        if name in table.columns:
            values = np.asarray(table.columns[name], dtype=np.float64)
            found.append({"name": name, "values": _few(values), "text": False})
        else:
            found.append({"name": name, "values": [], "text": True})
    return found


def guesses(raw: list[RawColumn]) -> dict[str, str]:
    """Return which columns of a file probably hold canonical columns that it does not name."""
    names = [str(c["name"]) for c in raw]
    found = {}
    for wanted in WANTED:
        if wanted not in names:
            near = likely(wanted, names)
            if near:
                found[wanted] = near
    return found


def columns(log: Log, mapping: dict[str, Any]) -> list[ColumnView]:
    """Return the canonical columns of a log: where each came from, its unit, range, and a few values to draw."""
    plan = Mapping.read(mapping or None)
    run = log.runs[0]
    found: list[ColumnView] = []
    for name in log.columns:
        if name == "run" or not is_canonical(name):
            continue
        parts = [r.channels[name] for r in log.runs if name in r.channels]
        column = plan.columns.get(name)
        low, high = _range(parts)
        source = name if column is None else (column.source or f"the constant {column.value:g}")
        found.append(
            {
                "name": name,
                "source": source,
                "unit": unit(name),
                "low": low,
                "high": high,
                "missing": sum(int(np.isnan(p).sum()) for p in parts),
                "scale": 1.0 if column is None else column.scale,
                "offset": 0.0 if column is None else column.offset,
                "delay": 0.0 if column is None else column.delay,
                "spark": _few(run.channels[name]) if name in run.channels else [],
            }
        )
    return found


def overview(log: Log) -> dict[str, Any]:
    """Return a log in a few numbers, and which traces can be drawn."""
    return {
        "name": log.name,
        "samples": log.samples,
        "duration": log.duration,
        "kind": log.kind,
        "runs": [
            {"number": r.number, "samples": r.samples, "begin": float(r.t[0]), "end": float(r.t[-1])}
            for r in log.runs
        ],
        "groups": {group: [n for n, _ in series_of(log.runs[0], group)] for group in GROUPS},
        "rate": float(np.median([1.0 / r.dt for r in log.runs])),
    }


def series_of(run: Run, group: str) -> list[tuple[str, np.ndarray]]:
    """Return the series of a run that are drawn together, under their names."""
    if group == "commands":
        if run.thrusters is not None:
            return [(f"thruster_{k + 1}", column) for k, column in enumerate(run.thrusters.T)]
        return [] if run.wrench is None else list(zip(WANTED[-6:], run.wrench.T, strict=True))
    if group == "fins":
        return [] if run.fins is None else [(f"fin_{k + 1}", column) for k, column in enumerate(run.fins.T)]
    if group == "attitude":
        return list(zip(GROUPS["attitude"], run.euler.T, strict=True))
    return [(name, run.channels[name]) for name in GROUPS.get(group, ()) if name in run.channels]


def run_of(log: Log, number: int | None) -> Run:
    """Return a run by number, the first one by default."""
    return log.runs[0] if number is None else log.select(number).runs[0]


def traces(
    log: Log, number: int | None, group: str, low: float | None, high: float | None, points: int
) -> dict[str, Any]:
    """Return the traces of one group of a run between two times, thinned.

    Args:
        log: the log that is shown.
        number: of the run; the first one where None.
        group: which channels: a group of `series_of`.
        low: begin, s on the run's clock; from its start where None.
        high: end, s; to its end where None.
        points: most points of each trace.
    """
    run = run_of(log, number)
    piece = part(run.t, low, high)
    series = {name: values[piece] for name, values in series_of(run, group)}
    # The same for every part of the run, and a sort of all its steps.
    if run not in _GAPS:
        _GAPS[run] = default_gap(run.t)
    return thin(run.t[piece], series, points, _GAPS[run])


def findings(quality: Quality) -> list[dict[str, Any]]:
    """Return the findings with the places in time that they concern, and buttons for their cures."""
    log = quality.log
    places = _places(log)
    found = []
    for finding in quality.findings:
        marks: list[Mark] = []
        for kind, where in places.items():
            if kind == finding.where or (kind in _WORDS and _WORDS[kind] in finding.what):
                marks += [
                    m
                    for m in where
                    if not finding.where.startswith("run ") or f"run {m['run']}" == finding.where
                ]
        entry = {**finding.to_dict(), "marks": marks[:200]}
        entry["buttons"] = buttons(finding.where, finding.what, finding.cure)
        found.append(entry)
    return found


# Places in time by a word of the finding that concerns them.
_WORDS = {"gap": "gaps in time", "restart": "the pose starts again"}


def _places(log: Log) -> dict[str, list[Mark]]:
    found: dict[str, list[Mark]] = {
        "gap": [],
        "restart": [],
        "spikes": [],
        "missing": [],
        "situation": [],
        "current": [],
    }

    def add(kind: str, run: Run, spans: list[list[float]]) -> None:
        found[kind].extend({"run": run.number, "from": a, "to": b} for a, b in spans)

    for run in log.runs:
        wide = np.flatnonzero(np.diff(run.t) > default_gap(run.t))
        add("gap", run, [[float(run.t[k]), float(run.t[k + 1])] for k in wide[:200]])
        add("restart", run, [[float(run.t[k] - run.dt), float(run.t[k])] for k in run.restarts[:200]])
        masks = [m for m in run.outliers.values() if m.any()]
        if masks:
            add("spikes", run, intervals(run.t, np.logical_or.reduce(masks), 200))
        if not run.valid.all():
            add("missing", run, intervals(run.t, ~run.valid, 200))
    for stretch in find(log):
        kind = "current" if stretch.kind == "drifting" else "situation"
        found[kind].append({"run": stretch.run, "from": stretch.start, "to": stretch.stop})
    return found


def _range(parts: list[np.ndarray]) -> tuple[float | None, float | None]:
    values = [p[np.isfinite(p)] for p in parts]
    values = [v for v in values if len(v)]
    if not values:
        return None, None
    return float(min(v.min() for v in values)), float(max(v.max() for v in values))


def _few(values: np.ndarray) -> list[float | None]:
    """Return some of the values, evenly spaced."""
    taken = values[:: max(1, len(values) // SPARK)][:SPARK]
    return [float(f"{x:.5g}") if np.isfinite(x) else None for x in taken.tolist()]
