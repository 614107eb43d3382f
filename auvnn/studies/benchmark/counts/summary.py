"""A benchmark counted: rates of each part, a table by condition, what was found of each effect, and the confusion."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from auvnn.answers import Answer, plain
from auvnn.diagnosis.hypotheses.stated_priors import GROUPS
from auvnn.studies.benchmark.cases import targets
from auvnn.studies.benchmark.counts import counting
from auvnn.studies.benchmark.counts.counting import (
    answer_of,
    false_names,
    given_names,
    in_group,
    kind_of,
    named_first,
)
from auvnn.studies.benchmark.counts.entries import PartRate, TargetEntry
from auvnn.studies.benchmark.counts.power import smallest_found
from auvnn.studies.benchmark.counts.rates import RATES, Z95, by_part, falls, judged, rate, z_of
from auvnn.studies.hidden import BEYOND, SIZES

Row = Mapping[str, Any]
KEYS = ("vehicle", "hidden", "size", "noise", "excitation")
# Where a row of an older benchmark lacks them.
FURTHER = {"plant": "own", "accelerations": None, "coefficients": "exact", "part": ""}


@dataclass(repr=False)
class Benchmark(Answer):
    """What the diagnosis found in logs with known hidden effects.

    Attributes:
        rows: one for each log.
        options: as asked for.
        metrics: named numbers.
        table: logs by what was hidden and how.
        rates: of each part of the plan, with 95 % intervals.
        targets: what was aimed at, and whether it was met.
        effects: what was found of each effect.
        confusion: hidden to answered to logs.
        uniformity: of the logs with nothing hidden, effect to p-values.
        warnings: what a reader must keep in mind.
    """

    kind = "benchmark"
    rows: list[dict[str, Any]]
    options: dict[str, Any]
    metrics: dict[str, float] = field(default_factory=dict)
    table: list[dict[str, Any]] = field(default_factory=list)
    rates: list[PartRate] = field(default_factory=list)
    targets: list[TargetEntry] = field(default_factory=list)
    effects: list[dict[str, Any]] = field(default_factory=list)
    confusion: dict[str, dict[str, int]] = field(default_factory=dict)
    uniformity: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """Return `benchmark.json`."""
        names = (
            "options",
            "metrics",
            "targets",
            "rates",
            "effects",
            "confusion",
            "uniformity",
            "table",
            "warnings",
        )
        return plain(
            {"schema": "auvnn/benchmark/1", **{n: getattr(self, n) for n in names}, "rows": self.rows}
        )


def summarise(rows: Sequence[Row], options: Mapping[str, Any]) -> Benchmark:
    """Return rates over all rows and by part, tables by condition and by effect, and the confusion matrix."""
    return Benchmark(
        list(map(dict, rows)),
        dict(options),
        _metrics(rows),
        _table(rows),
        by_part(rows),
        judged(rows, targets(options)),
        _effects(rows),
        _confusion(rows),
        _uniformity(rows),
        _warnings(rows),
    )


def _metrics(rows: Sequence[Row]) -> dict[str, float]:
    made = [r for r in rows if counting.was_made(r)]
    hidden = [r for r in made if kind_of(r) == "effect"]
    null = [r for r in made if kind_of(r) == "nothing"]
    given = [n for r in rows for n in given_names(r)]
    false = [n for r in rows for n in false_names(r)]
    zs = [z for r in rows for z in z_of(r)]
    relative = [worst for r in hidden if named_first(r) and (worst := _worst(r)) is not None]
    seconds = [r["seconds"] for r in rows if r.get("seconds") is not None]
    metrics = {
        "logs": len(rows),
        "logs_with_effect": len(hidden),
        "logs_with_several": sum(kind_of(r) == "several" for r in made),
        "logs_with_stranger": sum(kind_of(r) == "stranger" for r in made),
        "logs_with_nothing": len(null),
        "named_first_share": _share(map(named_first, hidden)),
        "named_alone_share": _share(map(counting.named_alone, hidden)),
        "named_or_in_group_share": _share(map(in_group, hidden)),
        "named_or_tied_share": _share(map(counting.named_or_tied, hidden)),
        "adequate_with_nothing": sum(r["verdict"] == "adequate" for r in null),
        "false_alarms_with_nothing": sum(r["verdict"] != "adequate" for r in null),
        "false_discovery_share": len(false) / len(given) if given else 0.0,
        "faults": sum(r["verdict"] == "fault" for r in rows),
        "not_made": len(rows) - len(made),
        "coverage_95_share": _share(abs(z) < Z95 for z in zs),
        "worst_relative_error": float(np.max(relative)) if relative else float("nan"),
        "median_seconds": float(np.median(seconds)) if seconds else float("nan"),
    }
    for name, key in (
        ("all_named", "several_all_named_share"),
        ("unknown_with_stranger", "stranger_unknown_share"),
        ("axis_of_stranger", "stranger_axis_share"),
        ("exact_ties", "exact_ties_share"),
        ("false_discovery_rate", "false_discovery_rate"),
        ("median_fall", "median_fall_share"),
    ):
        share = rate(name, rows)["share"]
        metrics[key] = float("nan") if share is None else share
    return metrics


def _table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    def key_of(row: Row) -> list[Any]:
        return [row[k] for k in KEYS] + [row.get(k, default) for k, default in FURTHER.items()]

    table = []
    for key, group in itertools.groupby(sorted(rows, key=lambda r: list(map(str, key_of(r)))), key_of):
        members = list(group)
        verdicts: dict[str, int] = {}
        for r in members:
            label = "+".join(r["missing"]) if r["verdict"] == "named" else r["verdict"]
            verdicts[label] = verdicts.get(label, 0) + 1
        errors = [worst for r in members if named_first(r) and (worst := _worst(r)) is not None]
        table.append(
            {
                **dict(zip((*KEYS, *FURTHER), key, strict=True)),
                "logs": len(members),
                "named_first": sum(map(named_first, members)),
                "in_group": sum(map(in_group, members)),
                "answers": verdicts,
                "worst_relative_error": float(np.max(errors)) if errors else None,
            }
        )
    return table


def _effects(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Return what was found of each effect that is hidden alone."""
    out = []
    single = [r for r in rows if kind_of(r) == "effect"]
    for effect in dict.fromkeys(r["hidden"] for r in single):
        members = [r for r in single if r["hidden"] == effect]
        zs = [z for r in members for z in z_of(r)]
        shares = {
            k: rate(k, members) for k in ("named_first", "named_alone", "named_or_in_group", "named_or_tied")
        }
        by_size = {
            size: {
                k: rate(k, [r for r in members if r["size"] == size])
                for k in ("named_first", "named_or_tied")
            }
            for size in sorted({r["size"] for r in members}, key=lambda s: SIZES.get(s, 0.0))
        }
        known = [r for r in members if r["size"] in SIZES and counting.was_made(r)]
        fallen = falls(members)
        out.append(
            {
                "effect": effect,
                "logs": len(members),
                **{k: {i: found[i] for i in ("hits", "share", "low", "high")} for k, found in shares.items()},
                "by_size": by_size,
                "size_in": "stated uncertainties" if effect in GROUPS else "standard errors",
                "size_90": smallest_found(
                    [size_of(effect, r["size"]) for r in known], [counting.named_or_tied(r) for r in known]
                ),
                "exact_ties": rate("exact_ties", members)["share"],
                "intervals": {"hits": sum(abs(z) < Z95 for z in zs), "count": len(zs)},
                "median_fall": float(np.median(fallen)) if fallen else None,
                "faults": sum(r["verdict"] == "fault" for r in members),
            }
        )
    return out


def size_of(effect: str, size: str) -> float:
    """Return what a size means for an effect: standard errors, or for a coefficient group stated uncertainties."""
    return BEYOND[size] if effect in GROUPS else SIZES[size]


def _confusion(rows: Sequence[Row]) -> dict[str, dict[str, int]]:
    """Return hidden to answered first to logs; logs with several effects are not in it."""
    out: dict[str, dict[str, int]] = {}
    for r in rows:
        if kind_of(r) != "several" and counting.was_made(r):
            line = out.setdefault(r["hidden"], {})
            line[answer_of(r)] = line.get(answer_of(r), 0) + 1
    return out


def _uniformity(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the p-values of every test at the nulls, effect by effect, and how far they are from uniform.

    `kolmogorov_smirnov` is the p-value of that test, one-sided against p-values that are too small. An effect with
    several starts is corrected for having taken the best, so that its p-values may only be too large.
    """
    from scipy.stats import kstest

    found: dict[str, list[float]] = {}
    for r in rows:
        for effect, p in (r.get("p_values") or {}).items():
            if kind_of(r) == "nothing" and p is not None:
                found.setdefault(effect, []).append(float(p))
    return {
        effect: {
            "p_values": sorted(values),
            "below_0.05": sum(p < 0.05 for p in values),
            "kolmogorov_smirnov": float(kstest(values, "uniform", alternative="greater").pvalue),
        }
        for effect, values in found.items()
    }


def _warnings(rows: Sequence[Row]) -> list[str]:
    out = []
    codes = {r["code"] for r in rows if r.get("code")}
    if len(codes) > 1:
        out.append(f"the rows were made by {len(codes)} versions of the code ({', '.join(sorted(codes))})")
    if any(
        r["verdict"] == "ambiguous" and not (r.get("imitation") or r.get("plant_imitation")) for r in rows
    ):
        out.append(
            "which groups a log really cannot tell apart was not worked out for every log (ties=true does it): "
            "a group counts as named only where it was"
        )
    return out


def _worst(row: Row) -> float | None:
    found = [e["relative"] for e in (row.get("errors") or {}).values() if e.get("relative") is not None]
    return max(found, default=None)


def _share(flags: Iterable[bool]) -> float:
    values = list(flags)
    return sum(values) / len(values) if values else float("nan")


__all__ = ["RATES", "Benchmark", "size_of", "summarise"]
