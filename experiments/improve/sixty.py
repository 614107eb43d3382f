"""How much of the truth's fall `improve` reaches on sixty fresh logs whose hidden effect costs 15, 40 or 150 %.

    python experiments/improve/sixty.py draw > experiments/improve/sixty.json       (done once, before any log was made)
    python experiments/improve/sixty.py run OUT [--count=60] [--seconds=600] [--no-diagnosis]
    python experiments/improve/sixty.py judge OUT

Logs are those of the core plan's kind: rov95 by the independent plant with drawn coefficients, a multisine, realistic
noise, four runs of 60 s at 20 Hz, and two further runs on which everything is judged. `run` adds a line to
OUT/rows.jsonl after each log and goes on where it was interrupted; the order of the logs is drawn too, so that a part of
them is a fair sample.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
COSTS, EACH, SEED, FIRST = ("15%", "40%", "150%"), 20, 20261122, 61000
VEHICLE = "rov95"
# What `improve` is to reach: the median of the shares, and the share that nine of ten reach.
MEDIAN, NINE_OF_TEN = 0.9, 0.75
HORIZON = "5"


def drawn() -> list[dict[str, Any]]:
    """Return the logs: every effect that the vehicle can have about as often as any other, at each cost."""
    from auvnn.studies.benchmark.cases import can_be_hidden
    from auvnn.vehicle import load_vehicle

    random = np.random.default_rng(SEED)
    names = sorted(can_be_hidden(load_vehicle(VEHICLE), "realistic", None, "numpy"))
    out = []
    for cost in COSTS:
        order = [names[i] for i in random.permutation(len(names))]
        chosen = [order[k % len(order)] for k in range(EACH)]
        out += [{"hidden": name, "size": cost} for name in chosen]
    out = [out[i] for i in random.permutation(len(out))]
    return [{**row, "seed": FIRST + k} for k, row in enumerate(out)]


def case_of(row: Mapping[str, Any]) -> Any:
    """Return the benchmark's case of a drawn log."""
    from auvnn.studies.benchmark.case import Case

    return Case(
        VEHICLE, row["hidden"], row["size"], "realistic", "multisine", "drawn", int(row["seed"]), 4, 60.0, 20.0,
        plant="numpy", held_out=2,
    )  # fmt: skip


def one(row: Mapping[str, Any], seconds: float, diagnosing: bool) -> dict[str, Any]:
    """Make a log, improve the model by it, and return the errors on the runs held out."""
    import auvnn
    from auvnn.metrics.rollouts import roll, scale_of
    from auvnn.models import load
    from auvnn.simulation import simulate
    from auvnn.studies.benchmark.costs import costly
    from auvnn.studies.benchmark.one_log import conditions

    case, model, began = case_of(row), load(VEHICLE), time.monotonic()
    kind = {**conditions(case), "plant": case.plant, "coefficients": case.coefficients, "world": None}
    hidden = {case.hidden: costly(model, case.hidden, 0.01 * float(case.size[:-1]), **kind)}
    whole = {**conditions(case), "runs": case.runs + case.held_out}
    made = simulate(model, hidden=hidden, coefficients="drawn", plant="numpy", max_step=0.025, **whole)
    numbers = [run.number for run in made.log.runs]
    log, test = made.log.select(numbers[: case.runs]), made.log.select(numbers[case.runs :])
    found = auvnn.improve(model, log, test=test, seconds=seconds, diagnosing=diagnosing)
    refitted = next((s.model for s in found.steps if s.kind == "coefficients refitted"), None) or model
    scale = scale_of(test)
    errors = {
        name: rolled.total(scale)
        for name, m in (
            ("given", model),
            ("refitted", refitted),
            ("found", found.model),
            ("true", made.plant),
        )
        if (rolled := roll(m, test, HORIZON, scale)) is not None
    }
    return {
        **row,
        "truth": hidden,
        "errors": errors,
        "share": share(errors, "given"),
        "share_from_refitted": share(errors, "refitted"),
        "steps": [{"step": s.step, "kind": s.kind} for s in found.steps],
        "verdicts": [d["verdict"] for d in found.diagnoses],
        "seconds": time.monotonic() - began,
    }


def share(errors: Mapping[str, float], start: str) -> float | None:
    """Return the share of the truth's fall that was reached, from a start; None where the truth falls by nothing."""
    fall = errors[start] - errors["true"]
    return None if fall <= 0.01 * errors["true"] else (errors[start] - errors["found"]) / fall


def judged(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the median and the lower tenth of the shares, and whether the targets are met."""
    out: dict[str, Any] = {"logs": len(rows), "faults": sum("fault" in r for r in rows)}
    for key in ("share", "share_from_refitted"):
        of = [r for r in rows if r.get(key) is not None]
        shares = np.array([r[key] for r in of])
        if not len(shares):
            continue
        out[key] = {
            "logs": len(shares),
            "median": float(np.median(shares)),
            "reach_three_quarters": float((shares >= NINE_OF_TEN).mean()),
            "met": bool(np.median(shares) >= MEDIAN and (shares >= NINE_OF_TEN).mean() >= 0.9),
            "by_cost": {
                c: float(np.median([r[key] for r in of if r["size"] == c]))
                for c in COSTS
                if any(r["size"] == c for r in of)
            },
        }
    return out


def run(out: Path, count: int, seconds: float, diagnosing: bool) -> None:
    """Work through the drawn logs; a fault is a row, not an end."""
    out.mkdir(parents=True, exist_ok=True)
    journal = out / "rows.jsonl"
    done = (
        {json.loads(line)["seed"] for line in journal.read_text().splitlines()} if journal.exists() else set()
    )
    for row in json.loads((HERE / "sixty.json").read_text())[:count]:
        if row["seed"] in done:
            continue
        try:
            found = one(row, seconds, diagnosing)
        except Exception as problem:
            found = {**row, "fault": f"{type(problem).__name__}: {problem}"[:300], "share": None}
        with journal.open("a") as file:
            file.write(json.dumps(found) + "\n")
        shown = found.get("share")
        print(row["hidden"], row["size"], "fault" if "fault" in found else shown, flush=True)


def main() -> None:
    """Draw, run or judge."""
    given = {k: v for k, _, v in (a[2:].partition("=") for a in sys.argv[1:] if a.startswith("--"))}
    what, *places = [a for a in sys.argv[1:] if not a.startswith("--")]
    if what == "draw":
        rows = drawn()
        print("[\n" + ",\n".join(json.dumps(r) for r in rows) + "\n]")
    elif what == "run":
        run(
            Path(places[0]),
            int(given.get("count", 60)),
            float(given.get("seconds", 600)),
            "no-diagnosis" not in given,
        )
    else:
        rows = [json.loads(line) for line in (Path(places[0]) / "rows.jsonl").read_text().splitlines()]
        print(json.dumps(judged(rows), indent=1))


if __name__ == "__main__":
    main()
