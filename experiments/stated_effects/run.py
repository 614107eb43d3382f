"""Effects that a model has already, in other people's worlds: named where they have changed, and left alone where not.

    python experiments/stated_effects/run.py OUT [every=8] [offset=0] [shift=45000000]
    python experiments/stated_effects/run.py OUT count       # of the rows in OUT, without making any

Of every case of the plan `worlds_made` with one effect without a shape, every so many, two days are made by the
independent plant in the case's world: on the first the effect has the case's values, and `auvnn.add` fits it to the
vehicle's model. That model is asked about the second day by `auvnn.diagnose` with its defaults, twice: once the effect
has a quarter of what it had (*changed*), once it has the same values (*the same*). Factors on coefficients are left
out: fitted, they are the vehicle's numbers. Rows go to OUT/rows.jsonl as they are done; cases that are there already
are not made again. Names that are true in a world by itself count neither as right nor as wrong.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import torch
import yaml

import auvnn
from auvnn.diagnosis.hypotheses.stated_priors import GROUPS
from auvnn.effects import EFFECTS
from auvnn.studies.benchmark.cases import Case, cases
from auvnn.studies.benchmark.one_log import STEP_WITH_NOISE, _hidden, conditions

HERE = Path(__file__).resolve().parent
PLAN = HERE.parents[1] / "configs/plan/worlds_made.yaml"
WORLDS = ("between", "disturbed", "shaped", "sensors", "conventions", "everything")
# What is left of the effect on the second day.
LEFT = 0.25


def chosen(every: int, offset: int, shift: int) -> list[Case]:
    """Return every so many of the plan's cases whose effect the model can have at other values."""
    plan = yaml.safe_load(PLAN.read_text())
    found, models = [], dict[str, Any]()
    for case in cases({"plan": plan, "only": list(WORLDS), "shift": shift}):
        if case.vehicle not in models:
            models[case.vehicle] = auvnn.load(case.vehicle)
        model = models[case.vehicle]
        shaped = any(p.shape for p in EFFECTS.get(case.hidden).describe(model.vehicle, model.actuation))
        if not shaped and case.hidden not in GROUPS:
            found.append(case)
    return found[offset::every]


def day(case: Case, hidden: dict[str, dict[str, float]], number: int) -> tuple[Any, list[str]]:
    """Return the log of a day in the case's world, and what is true there by itself.

    The second day are further runs of the same vehicle: its commands, its noise and its force are others.
    """
    more = {**conditions(case), "runs": number * case.runs, "plant": case.plant, "world": case.world}
    made = auvnn.simulate(
        auvnn.load(case.vehicle),
        hidden=hidden,
        coefficients=case.coefficients,
        max_step=STEP_WITH_NOISE,
        **more,
    )
    runs = [run.number for run in made.log.runs][-case.runs :]
    return made.log.select(runs), list((made.truth.get("world") or {}).get("true_names") or ())


def answered(case: Case, model: Any, hidden: dict[str, dict[str, float]]) -> dict[str, Any]:
    """Return what is said of the second day with such an effect."""
    (log, true), began = day(case, hidden, 2), time.monotonic()
    found = auvnn.diagnose(model, log, advice=False, whiteness=False)
    return {
        "verdict": found.verdict,
        "groups": [list(s["effects"]) for s in found.steps if s["effects"]],
        "stated": found.stated,
        "true": true,
        "nearest": found.nearest,
        "parameters": {c["effect"]: c["parameters"] for c in found.candidates}.get(case.hidden, {}),
        "seconds": round(time.monotonic() - began, 1),
    }


def of(case: Case) -> dict[str, Any]:
    """Return what a row says of its case."""
    return {
        "world": case.world,
        "vehicle": case.vehicle,
        "effect": case.hidden,
        "size": case.size,
        "seed": case.seed,
    }


def one(case: Case) -> dict[str, Any]:
    """Return the row of a case."""
    plain = auvnn.load(case.vehicle)
    hidden = _hidden(case, plain)
    described = EFFECTS.get(case.hidden).describe(plain.vehicle, plain.actuation)
    first = {p.name: hidden[case.hidden].get(p.name, p.null) for p in described}
    after = {p.name: p.null + LEFT * (first[p.name] - p.null) for p in described}
    row: dict[str, Any] = of(case)
    better = auvnn.add(plain, day(case, hidden, 1)[0], case.hidden, horizons=("5",))
    row |= {"accepted": better.accepted, "before": first, "after": after}
    row["changed"] = answered(case, better.model, {case.hidden: after})
    row["the same"] = answered(case, better.model, hidden)
    return row


def others(row: dict[str, Any], day: str) -> list[list[str]]:
    """Return what was said of a day, without names that are true in the world by itself; the effect's own is kept."""
    spare = {*row[day]["true"]} - {row["effect"]}
    left = [[n for n in group if n not in spare] for group in row[day]["groups"]]
    return [group for group in left if group]


def counts(rows: list[dict[str, Any]]) -> list[str]:
    """Return the counts of rows in words."""
    changed, same = ([others(r, day) for r in rows] for day in ("changed", "the same"))
    first = [bool(said) and r["effect"] in said[0] for r, said in zip(rows, changed, strict=True)]
    wrong = [bool(said) and not own for said, own in zip(changed, first, strict=True)]
    own = [any(r["effect"] in group for group in said) for r, said in zip(rows, same, strict=True)]
    return [
        f"changed: named first or in the first group {sum(first)} of {len(rows)}; another name first {sum(wrong)}",
        f"the same: no name {sum(not said for said in same)} of {len(rows)}; the effect itself {sum(own)}",
    ]


def main(out: Path, *, count: bool = False, **options: int) -> None:
    """Go through the cases and print what is said of each."""
    torch.set_num_threads(1)
    out.mkdir(parents=True, exist_ok=True)
    path = out / "rows.jsonl"
    rows = [json.loads(x) for x in path.read_text().splitlines()] if path.exists() else []
    done = {r["seed"] for r in rows}
    for case in () if count else chosen(**{"every": 8, "offset": 0, "shift": 45_000_000, **options}):
        if case.seed in done:
            continue
        rows.append(row := one(case))
        with path.open("a") as kept:
            kept.write(json.dumps(row) + "\n")
        said = (
            f"{d}: {', then '.join(' or '.join(g) for g in row[d]['groups']) or row[d]['verdict']}"
            for d in ("changed", "the same")
        )
        print(f"{row['world']} {row['vehicle']} {row['effect']} {row['size']}; {'; '.join(said)}", flush=True)
    print("\n".join(counts(rows)))


if __name__ == "__main__":
    folder, *words = sys.argv[1:]
    given = {k: int(v) for k, _, v in (word.partition("=") for word in words if word != "count")}
    main(Path(folder), count="count" in words, **given)
