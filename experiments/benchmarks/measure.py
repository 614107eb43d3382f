"""Time several contenders side by side: in turns, so that a busy machine is busy for all of them."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Timing:
    """Seconds of one contender: wall and processor time of each repeat, and what preparing it took once."""

    name: str
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)
    prepared: float | None = None
    skipped: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return medians and spread (lower and upper quartile; both ends for fewer than four)."""
        if self.skipped:
            return {"name": self.name, "skipped": self.skipped}
        return {
            "name": self.name,
            "repeats": len(self.cpu),
            "cpu_s": statistics.median(self.cpu),
            "cpu_spread_s": spread(self.cpu),
            "wall_s": statistics.median(self.wall),
            "wall_spread_s": spread(self.wall),
            "prepare_s": self.prepared,
        }


def spread(values: list[float]) -> list[float]:
    """Return lower and upper quartile, or both ends of fewer than four values."""
    if len(values) < 4:
        return [min(values), max(values)]
    low, _, high = statistics.quantiles(values, n=4)
    return [low, high]


def once(work: Callable[[], Any]) -> tuple[float, float]:
    """Return wall and processor seconds of one call."""
    wall, cpu = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - wall, time.process_time() - cpu


def race(
    contenders: list[tuple[str, Callable[[], Any] | str, int]], tell: Callable[[str], None] = print
) -> list[Timing]:
    """Time contenders in turns.

    Args:
        contenders: name; work, or why it is skipped; repeats. The first call of each is its preparation (compiling,
            warming up) and counts apart; where there are no repeats it is all there is, for the slowest.
        tell: called with a sentence per contender.
    """
    timings = [Timing(name, skipped=work if isinstance(work, str) else "") for name, work, _ in contenders]
    for timing, (_, work, _) in zip(timings, contenders, strict=True):
        if callable(work):
            tell(f"  preparing {timing.name}")
            first = once(work)
            timing.prepared = first[0]
            if not timings_wanted(contenders, timing.name):
                timing.wall.append(first[0])
                timing.cpu.append(first[1])
    for turn in range(max(repeats for _, _, repeats in contenders)):
        for timing, (_, work, repeats) in zip(timings, contenders, strict=True):
            if callable(work) and turn < repeats:
                wall, cpu = once(work)
                timing.wall.append(wall)
                timing.cpu.append(cpu)
    return timings


def timings_wanted(contenders: list, name: str) -> int:
    """Return the repeats of a contender."""
    return next(repeats for other, _, repeats in contenders if other == name)


def table(title: str, rows: list[dict[str, Any]]) -> str:
    """Return timings as a Markdown table, against the first that was not skipped."""
    lines = [
        f"### {title}",
        "",
        "| | CPU s, median (quartiles) | wall s | first call s | times ours |",
        "|---|---|---|---|---|",
    ]
    ours = next((r["cpu_s"] for r in rows if "cpu_s" in r), None)
    for r in rows:
        if "skipped" in r:
            lines.append(f"| {r['name']} | skipped: {r['skipped']} | | | |")
            continue
        low, high = r["cpu_spread_s"]
        lines.append(
            f"| {r['name']} | {r['cpu_s']:.4g} ({low:.3g} to {high:.3g}; {r['repeats']}) | {r['wall_s']:.4g} "
            f"| {r['prepare_s']:.3g} | {r['cpu_s'] / ours:.3g} |"
        )
    return "\n".join([*lines, ""])
