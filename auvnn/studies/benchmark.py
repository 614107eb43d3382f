"""The hidden-effect benchmark: hide, diagnose, count what was named, by effect, size, noise and manoeuvre."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from typing import Any

import numpy as np

from auvnn.answers import Answer, plain
from auvnn.effects import EFFECTS
from auvnn.errors import AuvnnError

NOTHING = "nothing"
# The plant's step, s: the error of 2e-5 m/s that the longer one leaves is far below any noise, but not below none.
STEP_WITHOUT_NOISE, STEP_WITH_NOISE = 0.01, 0.025


@dataclass(frozen=True)
class Case:
    """One log of the benchmark.

    Attributes:
        vehicle: built-in name.
        hidden: effect, or "nothing".
        size: small, medium or large; of no meaning where nothing is hidden.
        noise: condition.
        excitation: manoeuvre.
        coefficients: "exact" or "drawn".
        seed: of everything.
        runs: of the log.
        duration: of each run, s.
        rate: samples per second.
    """

    vehicle: str
    hidden: str
    size: str
    noise: str
    excitation: str
    coefficients: str
    seed: int
    runs: int
    duration: float
    rate: float


def cases(options: Mapping[str, Any]) -> list[Case]:
    """Return every combination of the options' lists, each log with a seed of its own."""

    def several(key: str) -> list[Any]:
        value = options[key]
        return list(value) if isinstance(value, (list, tuple)) else [value]

    effects = [n for e in several("effects") for n in (EFFECTS.names() if e == "all" else [e])]
    for name in effects:
        if name != NOTHING:
            EFFECTS.get(name)
    out = []
    for vehicle, hidden, size, noise, excitation, repeat in itertools.product(
        several("vehicles"),
        effects,
        several("sizes"),
        several("noises"),
        several("excitations"),
        range(int(options["repeats"])),
    ):
        if hidden == NOTHING and size != several("sizes")[0]:
            continue
        seed = int(options["seed"]) + repeat
        out.append(
            Case(
                vehicle,
                hidden,
                size if hidden != NOTHING else "none",
                noise,
                excitation,
                str(options["coefficients"]),
                seed,
                int(options["runs"]),
                float(options["duration"]),
                float(options["rate"]),
            )
        )
    return out


def run_case(case: Case) -> dict[str, Any]:
    """Hide, diagnose, and return what came out, as plain data; a fault is an outcome, not an end."""
    import torch

    from auvnn.diagnosis import diagnose
    from auvnn.models import load
    from auvnn.simulate import simulate
    from auvnn.studies.hidden import sized

    torch.set_num_threads(1)
    row: dict[str, Any] = asdict(case)
    began = time.monotonic()
    try:
        model = load(case.vehicle)
        how = {
            "excitation": case.excitation,
            "noise": case.noise,
            "seed": case.seed,
            "runs": case.runs,
            "duration": case.duration,
            "rate": case.rate,
        }
        hidden = {} if case.hidden == NOTHING else {case.hidden: sized(model, case.hidden, case.size, **how)}
        step = STEP_WITHOUT_NOISE if case.noise == "none" else STEP_WITH_NOISE
        made = simulate(model, hidden=hidden, coefficients=case.coefficients, max_step=step, **how)
        found = diagnose(model, made.log, advice=False)
    except AuvnnError as problem:
        return {
            **row,
            "verdict": "fault",
            "missing": [],
            "fault": str(problem),
            "seconds": time.monotonic() - began,
        }
    row.update(
        verdict=found.verdict,
        missing=found.missing,
        p_value=found.global_p_value,
        steps=[s["verdict"] for s in found.steps],
        fault=None,
        seconds=time.monotonic() - began,
        truth=hidden,
        ranking=[c["effect"] for c in found.candidates[:3]],
        parameters={},
    )
    for candidate in found.candidates:
        if candidate["effect"] == case.hidden:
            row["parameters"] = candidate["parameters"]
    row["errors"] = _errors(row)
    return plain(row)


def _errors(row: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Return each parameter's error, relative to the effect's size, and in standard errors."""
    truth = row["truth"].get(row["hidden"], {})
    out = {}
    if not truth:
        return out
    described = EFFECTS.get(row["hidden"]).describe(*_described(row["vehicle"]))
    # A shape has no distance from its null.
    null = {p.name: p.null for p in described if not p.shape}
    size = max(np.sqrt(sum((truth[n] - v) ** 2 for n, v in null.items())), 1e-300)
    for name, value in truth.items():
        found = row["parameters"].get(name)
        if name not in null or found is None or found["value"] is None:
            continue
        gap = found["value"] - value
        out[name] = {
            "relative": abs(gap) / size,
            "z": gap / found["std"] if found["std"] and np.isfinite(found["std"]) else float("nan"),
        }
    return out


def _described(vehicle: str) -> tuple[Any, str]:
    from auvnn.vehicle import load_vehicle

    known = load_vehicle(vehicle)
    return known, "thrusters" if known.thrusters else "wrench"


def named_first(row: Mapping[str, Any]) -> bool:
    """Whether the hidden effect, and it alone, was named in the first step."""
    return row["verdict"] == "named" and bool(row["missing"]) and row["missing"][0] == row["hidden"]


def in_group(row: Mapping[str, Any]) -> bool:
    """Whether the hidden effect was named, or is a member of a group declared ambiguous."""
    return named_first(row) or (row["verdict"] == "ambiguous" and row["hidden"] in row["missing"])


def false_names(row: Mapping[str, Any]) -> list[str]:
    """Return the names that were given and are not hidden; members of a declared group are not given as names."""
    if row["verdict"] in ("ambiguous", "fault"):
        return []
    return [n for n in row["missing"] if n != row["hidden"]]


@dataclass
class Benchmark(Answer):
    """What the diagnosis found in logs with known hidden effects."""

    kind = "benchmark"
    rows: list[dict[str, Any]]
    options: dict[str, Any]
    metrics: dict[str, float] = field(default_factory=dict)
    table: list[dict[str, Any]] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return `benchmark.json`."""
        return plain(
            {
                "schema": "auvnn/benchmark/1",
                "options": self.options,
                "metrics": self.metrics,
                "table": self.table,
                "rows": self.rows,
            }
        )


def summarise(rows: Sequence[Mapping[str, Any]], options: Mapping[str, Any]) -> Benchmark:
    """Return rates over all rows, and a table by effect, size, noise and manoeuvre."""
    hidden = [r for r in rows if r["hidden"] != NOTHING]
    null = [r for r in rows if r["hidden"] == NOTHING]
    given = [n for r in rows if r["verdict"] == "named" for n in r["missing"]]
    false = [n for r in rows for n in false_names(r)]
    zs = [
        e["z"]
        for r in hidden
        if named_first(r)
        for e in r["errors"].values()
        if np.isfinite(e["z"] or np.nan)
    ]
    relative = [
        max((e["relative"] for e in r["errors"].values()), default=np.nan) for r in hidden if named_first(r)
    ]
    metrics = {
        "logs": len(rows),
        "logs_with_effect": len(hidden),
        "logs_with_nothing": len(null),
        "named_first_share": _share(map(named_first, hidden)),
        "named_or_in_group_share": _share(map(in_group, hidden)),
        "adequate_with_nothing": sum(r["verdict"] == "adequate" for r in null),
        "false_alarms_with_nothing": sum(r["verdict"] != "adequate" for r in null),
        "false_discovery_share": len(false) / len(given) if given else 0.0,
        "faults": sum(r["verdict"] == "fault" for r in rows),
        "coverage_95_share": _share(abs(z) < 1.96 for z in zs),
        "worst_relative_error": float(np.max(relative)) if relative else float("nan"),
        "median_seconds": float(np.median([r["seconds"] for r in rows])) if rows else float("nan"),
    }
    table = []
    keys = ("vehicle", "hidden", "size", "noise", "excitation")
    for key, group in itertools.groupby(
        sorted(rows, key=lambda r: [r[k] for k in keys]), lambda r: [r[k] for k in keys]
    ):
        members = list(group)
        verdicts: dict[str, int] = {}
        for r in members:
            label = "+".join(r["missing"]) if r["verdict"] == "named" else r["verdict"]
            verdicts[label] = verdicts.get(label, 0) + 1
        errors = (
            [
                max((e["relative"] for e in r["errors"].values()), default=np.nan)
                for r in members
                if named_first(r)
            ]
            if key[1] != NOTHING
            else []
        )
        table.append(
            {
                **dict(zip(keys, key, strict=True)),
                "logs": len(members),
                "named_first": sum(map(named_first, members)),
                "in_group": sum(map(in_group, members)),
                "answers": verdicts,
                "worst_relative_error": float(np.max(errors)) if errors else None,
            }
        )
    return Benchmark(list(map(dict, rows)), dict(options), metrics, table)


def _share(flags: Iterable[bool]) -> float:
    values = list(flags)
    return sum(values) / len(values) if values else float("nan")


def benchmark(options: Mapping[str, Any], progress: Callable[[str], None] | None = None) -> Benchmark:
    """Run all cases on several processes and count.

    Args:
        options: `effects`, `sizes`, `noises`, `excitations`, `vehicles` (names or lists; effects may be "all" and
            "nothing"), `coefficients`, `repeats`, `seed`, `runs`, `duration`, `rate`, `workers`.
        progress: told after each log.
    """
    todo = cases(options)
    rows = []
    for done, row in enumerate(_all(todo, int(options.get("workers") or os.cpu_count() or 1)), start=1):
        rows.append(row)
        if progress is not None:
            progress(
                f"{done} of {len(todo)}: {row['hidden']} {row['size']} seed {row['seed']}: {row['verdict']} "
                f"{'+'.join(row['missing'])}"
            )
    order = {case: k for k, case in enumerate(todo)}
    rows.sort(key=lambda r: order[Case(**{k: r[k] for k in Case.__dataclass_fields__})])
    return summarise(rows, options)


def _all(todo: Sequence[Case], workers: int) -> Iterator[dict[str, Any]]:
    if workers <= 1 or len(todo) == 1:
        yield from map(run_case, todo)
        return
    # Spawned, not forked: torch's threads do not survive a fork.
    with ProcessPoolExecutor(min(workers, len(todo)), mp_context=get_context("spawn")) as pool:
        futures: list[Future] = [pool.submit(run_case, case) for case in todo]
        for future in as_completed(futures):
            yield future.result()
