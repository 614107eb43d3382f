"""What a model that one day has made better predicts of the next, beside a plain regression, in other people's worlds.

    python experiments/stated_effects/second_day.py OUT [improve] [every=10] [offset=0] [shift=47000000]
    python experiments/stated_effects/second_day.py OUT [improve] count     # of the rows in OUT, without making any

The cases are those of `run.py`, of another shift. On the first day `auvnn.add` fits the effect that is there, as one who
knows its name, or `auvnn.improve` looks for whatever is missing, as one who knows nothing; the next day is held out as a
whole, and the regression is fitted to the first. Errors are those of 5 s of free running, in standard deviations of the
motion. Rows go to OUT/days.jsonl, with `improve` to OUT/improved.jsonl.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from statistics import median
from typing import Any

import run as days
import torch

import auvnn
from auvnn.studies.benchmark.cases import Case
from auvnn.studies.benchmark.one_log import _hidden


def one(case: Case) -> dict[str, Any]:
    """Return the row of a case."""
    plain = auvnn.load(case.vehicle)
    hidden = _hidden(case, plain)
    (first, _), (second, _) = days.day(case, hidden, 1), days.day(case, hidden, 2)
    began = time.monotonic()
    better = auvnn.add(plain, first, case.hidden, test=second, horizons=("5",))
    told = better.to_dict()
    errors = {w["step"]: w["error"] for w in told["waterfall"]}
    return {
        **days.of(case),
        "accepted": told["accepted"],
        "as given": errors["as given"],
        "with it": errors[case.hidden],
        "regression": told["baseline"]["total"],
        "noise floor": errors["noise floor"],
        "commands": (told.get("commands") or {}).get("between_samples", "held"),
        "seconds": round(time.monotonic() - began, 1),
    }


def whole(case: Case) -> dict[str, Any]:
    """Return the row of a case for the whole loop: nothing is said of what is there."""
    plain = auvnn.load(case.vehicle)
    hidden = _hidden(case, plain)
    (first, true), (second, _) = days.day(case, hidden, 1), days.day(case, hidden, 2)
    began = time.monotonic()
    told = auvnn.improve(plain, first, test=second).to_dict()
    *steps, floor = told["waterfall"]
    return {
        **days.of(case),
        "accepted": len(steps) > 1,
        "as given": steps[0]["error"],
        "with it": steps[-1]["error"],
        "regression": told["baseline"]["total"],
        "noise floor": floor["error"],
        "steps": [s["step"] for s in steps[1:]],
        "true in the world": true,
        "seconds": round(time.monotonic() - began, 1),
    }


def counts(rows: list[dict[str, Any]]) -> list[str]:
    """Return by world and in all: how often the model predicts better than the regression, and the medians."""
    out = []
    for world in (*sorted({r["world"] for r in rows}), "all"):
        own = [r for r in rows if world in (r["world"], "all")]
        better = sum(r["with it"] < r["regression"] for r in own)
        taken = sum(r["accepted"] for r in own)
        middle = {k: median(r[k] for r in own) for k in ("as given", "with it", "regression", "noise floor")}
        told = ", ".join(f"{k} {v:.3f}" for k, v in middle.items())
        out.append(
            f"{world}: accepted {taken} of {len(own)}, better than the regression {better}; medians: {told}"
        )
    return out


def main(out: Path, *, count: bool = False, improve: bool = False, **options: int) -> None:
    """Go through the cases and print what came of each."""
    torch.set_num_threads(1)
    out.mkdir(parents=True, exist_ok=True)
    path = out / ("improved.jsonl" if improve else "days.jsonl")
    rows = [json.loads(x) for x in path.read_text().splitlines()] if path.exists() else []
    done = {r["seed"] for r in rows}
    for case in () if count else days.chosen(**{"every": 10, "offset": 0, "shift": 47_000_000, **options}):
        if case.seed in done:
            continue
        rows.append(row := (whole if improve else one)(case))
        with path.open("a") as kept:
            kept.write(json.dumps(row) + "\n")
        print(*(f"{k} {v:.3f}" if isinstance(v, float) else str(v) for k, v in row.items()), flush=True)
    print("\n".join(counts(rows)))


if __name__ == "__main__":
    folder, *words = sys.argv[1:]
    given = {k: int(v) for k, _, v in (word.partition("=") for word in words if "=" in word)}
    main(Path(folder), count="count" in words, improve="improve" in words, **given)
