"""Knock-out on a real vehicle: take each effect out of the improved model and ask what is missing.

    python experiments/beluga/knockout.py DATA [OUT] [effect ...] [--scaled] [--lively | --one-step]

DATA is the folder with Beluga's six CSV files, OUT that of `run.py`, which left the improved model in it. Each effect
of the model is removed alone, and `diagnose` gets the fitted runs in windows of 2 s, the whole catalogue, and nothing
of what was removed; with `--lively` it gets the liveliest minute of each fitted run. The effect has come back when it
is the first one that the answer says is missing, or in the group that is declared as one that these data cannot tell
apart. `random-2` takes no part.

With `--scaled` the model first gets the scale of the velocity sensor that a diagnosis of the whole model finds.
With `--one-step` the catalogue is ranked instead by what each effect gains one step ahead on fifths of the whole fitted
runs left out (`auvnn.diagnosis.one_step.rank`), which is what the model's effects were chosen and fitted by. Beside it
stands which effect's gain is most above what it gains on the whole model: that is told and does not count.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import torch
from glitches import without_glitches
from run import FILTER, FITTED, SECONDS, WINDOW, first, lively, read

from auvnn.answers import plain
from auvnn.diagnosis import diagnose, rank_one_step
from auvnn.logs import Log
from auvnn.models import GreyBox, load, remove

MOST = 2  # names one after the other: the first decides, the second tells whether it comes back at all
SHOWN = 6  # of the ranking
SCALE = {"velocity_scale": {"factor": 1.024}}  # by the diagnosis of the whole model beside a force


def fitted_runs(data: Path) -> Log:
    """Return the fitted runs, poses that contradict the velocities left out."""
    log, _ = without_glitches(read(data, FITTED, "mapping.yaml"))
    return Log.from_runs([*(first(r, SECONDS) for r in log.runs[:-1]), log.runs[-1]], name="beluga")


def one_step_case(model: GreyBox, log: Log, removed: str | None) -> dict:
    """Rank the catalogue one step ahead for the model without one effect, or as it is."""
    began = time.monotonic()
    ranking = rank_one_step(
        model if removed is None else remove(model, removed),
        log,
        derivative=FILTER,
        progress=lambda words: print("   ", words, round(time.monotonic() - began), flush=True),
    )
    names = [r.effect for r in ranking]
    own = next((r for r in ranking if r.effect == removed), None)
    return {
        "removed": removed,
        "rank": names.index(removed) + 1 if own is not None else None,
        "named_first": own is not None and names[0] == removed and own.pays,
        "in_first_group": own is not None and own.tied and own.pays,
        "group": [r.effect for r in ranking if r.tied and r.pays],
        "own": own and own.to_dict(),
        "ranking": [r.to_dict() for r in ranking[:SHOWN]],
        "gains": {r.effect: r.gain for r in ranking},
        "seconds": round(time.monotonic() - began, 1),
    }


def case(model: GreyBox, log: Log, removed: str | None) -> dict:
    """Diagnose the model without one effect, or as it is, and say whether the effect came back and how."""
    began = time.monotonic()
    lacking = model if removed is None else remove(model, removed)
    found = diagnose(lacking, log, max_effects=MOST, window=WINDOW, advice=False)
    steps = [{k: s[k] for k in ("verdict", "effects", "p_value")} for s in found.steps]
    entry = next((c for c in found.candidates if c["effect"] == removed), None)
    by_p = sorted(
        (c for c in found.candidates if c["p_value"] is not None),
        key=lambda c: (c["p_value"], -(c["explained"] or 0)),
    )
    return {
        "removed": removed,
        "verdict": found.verdict,
        "steps": steps,
        "missing": list(found.missing),
        "named_first": removed is not None and [*found.missing][:1] == [removed] and found.verdict == "named",
        "in_first_group": found.verdict == "ambiguous" and removed in found.missing,
        "nearest": list(found.nearest),
        "named_later": any(removed in s["effects"] for s in found.steps[1:]),
        "rank_by_evidence": [c["effect"] for c in found.candidates].index(removed) + 1 if removed else None,
        "rank_by_p_value": [c["effect"] for c in by_p].index(removed) + 1
        if entry and entry in by_p
        else None,
        "p_value": entry and entry["p_value"],
        "confusable_with": entry and entry["confusable_with"][:3],
        "parameters": entry and entry["parameters"],
        "ranking": [
            {k: c[k] for k in ("effect", "p_value", "explained", "cv_before", "cv_after")}
            for c in found.candidates[:SHOWN]
        ],
        "seconds": round(time.monotonic() - began, 1),
    }


def main() -> None:
    """Go through the model's effects and write `knockout.json`."""
    torch.set_num_threads(1)
    if len(sys.argv) < 2 or not Path(sys.argv[1]).is_dir():
        print("skipped: Beluga's logs are not here; give the folder that holds its six CSV files")
        return
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    data, out = Path(arguments[0]), Path(arguments[1] if len(arguments) > 1 else "outputs/beluga")
    model, log = load(out / "model"), fitted_runs(data)
    kept = model.effect_names
    if "--scaled" in sys.argv:
        model = model.with_effects(SCALE)
    one_step = "--one-step" in sys.argv
    asked = lively(log) if "--lively" in sys.argv else log
    cases = []
    for name in arguments[2:] or ["none", *kept]:
        removed = None if name == "none" else name
        found = one_step_case(model, log, removed) if one_step else case(model, asked, removed)
        cases.append(found)
        if one_step:
            told = ", ".join(f"{r['effect']} {r['gain']:.3f} +- {r['std']:.3f}" for r in found["ranking"][:3])
        else:
            told = " then ".join(
                f"{s['verdict']} {' or '.join(s['effects'])}".strip() for s in found["steps"]
            )
            told += f"; missing {', '.join(found['missing'])}" if found["missing"] else ""
            told += f"; nearest {', '.join(found['nearest'])}" if found["nearest"] else ""
        print(f"without {name}: {told} ({found['seconds']} s)", flush=True)
        back = sum(bool(c["named_first"] or c.get("in_first_group")) for c in cases)
        of = sum(c["removed"] is not None for c in cases)
        answer = {"cases": cases, "came_back": back, "of": of}
        kind = "-scaled" if "--scaled" in sys.argv else ""
        kind += "-one-step" if one_step else "-lively" if asked is not log else ""
        file = out / f"knockout{kind}.json"
        file.write_text(json.dumps(plain(answer), indent=1), encoding="utf-8")
    print(f"came back: {back} of {of}")
    if one_step and "gains" in cases[0] and cases[0]["removed"] is None:
        for found in cases[1:]:
            grown = {n: g - cases[0]["gains"].get(n, 0.0) for n, g in found["gains"].items()}
            most = sorted(grown, key=lambda n: -grown[n])[:2]
            told = ", ".join(f"{n} {grown[n]:.3f}" for n in most)
            print(f"without {found['removed']}, gain above that on the whole model: {told}")


if __name__ == "__main__":
    main()
