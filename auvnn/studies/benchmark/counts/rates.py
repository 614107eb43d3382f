"""Rates with their intervals, and whether they are what was aimed at."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.special import ndtri

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError
from auvnn.studies.benchmark.counts import counting, worlds
from auvnn.studies.benchmark.counts.counting import Row, kind_of
from auvnn.studies.benchmark.counts.entries import PartRate, RateEntry, TargetEntry

Z95 = 1.96


def z_of(row: Row) -> list[float]:
    """Return the errors in standard errors of the parameters of hidden effects that were named.

    What the row's world has of the effect by itself is part of the truth, and an angle is the same a whole turn later.
    """
    kept, own = [], worlds.own_amounts(row)
    for name, error in (row.get("errors") or {}).items():
        z = error["z"]
        if z is None or not np.isfinite(z):
            continue
        z = counting.wrapped_error(row, name, z)
        z -= own[name] / row["parameters"][name]["std"] if name in own else 0.0
        if kind_of(row) == "several":
            # Called by effect and parameter; what was not named was never fitted in earnest.
            if name.partition(".")[0] in counting.given_names(row):
                kept.append(float(z))
        elif counting.named_first(row):
            kept.append(float(z))
    return kept


def _of(kinds: str | tuple[str, ...], hit: Callable[[Row], bool]) -> Callable[[Sequence[Row]], list[bool]]:
    return lambda rows: [bool(hit(r)) for r in rows if kind_of(r) in kinds and counting.was_made(r)]


def _within(rows: Sequence[Row]) -> list[bool]:
    return [abs(z) < Z95 for r in rows for z in z_of(r)]


def _tie(row: Row) -> bool:
    return any(
        d is not None and d <= counting.TIED for d in (row["imitation"].get(row["hidden"]) or {}).values()
    )


# Each rate: of which logs (or names, or parameters) it is a share, and which of them count.
RATES: dict[str, Callable[[Sequence[Row]], list[bool]]] = {
    "named_first": _of(("effect",), counting.named_first),
    "named_alone": _of(("effect",), counting.named_alone),
    "named_or_in_group": _of(("effect",), counting.in_group),
    "named_or_tied": _of(("effect",), counting.named_or_tied),
    "named_or_tied_at_2": _of(("effect",), lambda row: counting.named_or_tied(row, counting.STRICT)),
    "all_named": _of(("several",), counting.all_named),
    "all_shown_named": _of(("several",), counting.all_shown_named),
    "several_named_alone": _of(("several",), counting.named_alone),
    "adequate_with_nothing": _of(("nothing",), counting.right_verdict),
    "unknown_with_stranger": _of(("stranger",), counting.right_verdict),
    "axis_of_stranger": _of(("stranger",), counting.right_axis),
    "false_names": lambda rows: [
        n not in counting.effects_of(r) for r in rows for n in counting.given_names(r)
    ],
    "coverage_95": _within,
    "exact_ties": lambda rows: [_tie(r) for r in rows if kind_of(r) == "effect" and r.get("imitation")],
    "unseen": lambda rows: [
        counting.unseen(r) for r in rows if kind_of(r) == "effect" and r.get("imitation")
    ],
    "not_made": lambda rows: [not counting.was_made(r) for r in rows],
    "faults": lambda rows: [r["verdict"] == "fault" for r in rows],
    **worlds.RATES,
}


def falls(rows: Sequence[Row]) -> list[float]:
    """Return the held-out falls as shares of what the true effects give, of the logs where that is known."""
    found = [(r.get("fall") or {}).get("share") for r in rows if kind_of(r) in ("effect", "several")]
    return [float(share) for share in found if share is not None]


# What is no share of a count: a median, a mean.
NUMBERS: dict[str, Callable[[Sequence[Row]], list[float]]] = {
    "median_fall": falls,
    "false_discovery_rate": lambda rows: [counting.false_share(r) for r in rows if r["verdict"] != "fault"],
    **worlds.NUMBERS,
}


def interval(hits: float, count: int) -> tuple[float, float]:
    """Return Wilson's 95 % interval of a share, or of the mean of numbers between 0 and 1.

    Such numbers with mean m have a variance of at most m (1 - m), that of a share: for them the interval is, if
    anything, too wide. It never leaves 0 to 1, and has a width at both ends.

    Args:
        hits: how many count, or the sum of the numbers.
        count: of how many, at least 1.

    References:
        Wilson, E. B. (1927), J. Am. Stat. Assoc. 22(158), 209-212.
    """
    z = float(ndtri(0.975))
    p, scale = hits / count, 1.0 + z**2 / count
    middle = (p + z**2 / (2 * count)) / scale
    half = z * float(np.sqrt(p * (1 - p) / count + z**2 / (4 * count**2))) / scale
    return 0.0 if hits == 0 else middle - half, 1.0 if hits == count else middle + half


def rate(name: str, rows: Sequence[Row]) -> RateEntry:
    """Return a rate: hits, count, share and its interval; the share is None where there is nothing to count.

    A median has the interval of its order statistics, a mean of shares Wilson's; no hits are counted for them.

    Raises:
        ConfigError: there is no such rate.
    """
    if name in RATES:
        flags = RATES[name](rows)
        hits, count = sum(flags), len(flags)
        low, high = interval(hits, count) if count else (None, None)
        share = hits / count if count else None
        return {"rate": name, "hits": hits, "count": count, "share": share, "low": low, "high": high}
    if name not in NUMBERS:
        raise ConfigError(unknown_name("rate", name, [*RATES, *NUMBERS]))
    values = np.sort(NUMBERS[name](rows))
    count = len(values)
    share = low = high = None
    if count and name.startswith("median"):
        share, (low, high) = float(np.median(values)), _around_median(values)
    elif count:
        share = float(np.mean(values))
        low, high = interval(min(max(float(np.sum(values)), 0.0), count), count)
    return {"rate": name, "hits": None, "count": count, "share": share, "low": low, "high": high}


def _around_median(values: np.ndarray) -> tuple[float | None, float | None]:
    """Return order statistics that hold the median with at least 95 %, whatever the distribution; None if too few."""
    from scipy.stats import binom

    count = len(values)
    rank = int(binom.ppf(0.025, count, 0.5))
    if rank < 1:
        return None, None
    return float(values[rank - 1]), float(values[count - rank])


def by_part(rows: Sequence[Row]) -> list[PartRate]:
    """Return every rate of every part of the plan that has anything to count, "all" first."""
    parts: dict[str, list[Row]] = {"all": list(rows)}
    for row in rows:
        if row.get("part"):
            parts.setdefault(str(row["part"]), []).append(row)
    out: list[PartRate] = []
    for part, members in parts.items():
        for name in (*RATES, *NUMBERS):
            found = rate(name, members)
            if found["count"]:
                out.append({"part": part, **found})
    return out


def judged(rows: Sequence[Row], aims: Iterable[Mapping[str, Any]]) -> list[TargetEntry]:
    """Return what was aimed at and what came out, and whether it was met; None where nothing was counted.

    Args:
        rows: all rows.
        aims: `part` ("all" for all), `rate`, and `least` or `most` or both; `sizes` leaves out logs of other sizes.
    """
    out: list[TargetEntry] = []
    for aim in aims:
        sizes = aim.get("sizes")
        members = [
            r
            for r in rows
            if (aim["part"] == "all" or r.get("part") == aim["part"])
            and (not sizes or set(str(r["size"]).split("+")) <= set(sizes))
        ]
        found = rate(str(aim["rate"]), members)
        least, most, share = aim.get("least"), aim.get("most"), found["share"]
        met = None
        if share is not None:
            met = (least is None or share >= least) and (most is None or share <= most)
        out.append({"part": aim["part"], **found, "least": least, "most": most, "met": met})
    return out
