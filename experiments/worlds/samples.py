"""The samples of other people's worlds side by side, from the rows that are kept.

python experiments/worlds/samples.py
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from auvnn.studies.benchmark.counts import worlds
from auvnn.studies.benchmark.counts.rates import Z95, z_of

HERE = Path(__file__).resolve().parent
WORLDS = ("between", "disturbed", "shaped", "sensors", "conventions", "everything")
HEAD = "| sample | logs | visible, named or tied | wrong first | no false name | adequate | force right | intervals |"
# Since this sample the force is told by its law, where a Fourier series in each window told it before.
SINCE = 12
Rows = Sequence[dict[str, Any]]


def samples() -> dict[int, Rows]:
    """Return the rows of every sample by its number."""
    names = ["rows.jsonl", *(f"rows-{k}.jsonl" for k in range(2, 1000))]
    there = [HERE / n for n in names if (HERE / n).exists()]
    return {k + 1: [json.loads(x) for x in p.read_text().splitlines()] for k, p in enumerate(there)}


def counted(rows: Rows) -> list[str]:
    """Return what a line of the table says of rows."""
    seen = [r for r in rows if r["kind"] == "effect" and worlds.visible(r)]
    nothing = [r for r in rows if r["kind"] == "nothing"]
    plain = [r for r in nothing if not r["world"].startswith(("disturbed", "everything"))]
    forces = [x for r in rows if r["world"].startswith("disturbed") for x in worlds.force_right(r)]
    zs = [z for r in rows for z in z_of(r)]
    pairs = (
        (map(worlds.right, seen), len(seen)),
        (map(worlds.wrong_first, rows), len(rows)),
        (map(worlds.silent, nothing), len(nothing)),
        (map(worlds.adequate, plain), len(plain)),
        (forces, len(forces)),
        ((abs(z) < Z95 for z in zs), len(zs)),
    )
    return [str(len(rows)), *(f"{sum(hits)} of {count}" if count else "–" for hits, count in pairs)]


def forces(first: int) -> tuple[int, int]:
    """Return how often the force in `disturbed` is right where nothing is hidden, since some sample, and of how many."""
    rows = [r for k, of in samples().items() if k >= first for r in of]
    told = [x for r in rows if r["part"] == "disturbed_nothing" for x in worlds.force_right(r)]
    return sum(told), len(told)


def table(last: int | None = None) -> list[str]:
    """Return the lines of the table of all samples, or of the worlds over the last so many samples."""
    found = samples()
    if last is None:
        groups = {str(k): rows for k, rows in found.items()}
        groups["all"] = [r for rows in found.values() for r in rows]
    else:
        rows = [r for k in list(found)[-last:] for r in found[k]]
        groups = {w: [r for r in rows if r["world"].startswith(w)] for w in WORLDS} | {"all": rows}
    head = HEAD if last is None else HEAD.replace("sample", "world", 1)
    return [head, "|---" * 8 + "|", *("| " + " | ".join([k, *counted(r)]) + " |" for k, r in groups.items())]


if __name__ == "__main__":
    right, of = forces(SINCE)
    told = f"Force right where nothing is hidden, since sample {SINCE}: {right} of {of}."
    print("\n".join(table()), "\n\nThe last three samples by world:\n", *table(3), "", told, sep="\n")
