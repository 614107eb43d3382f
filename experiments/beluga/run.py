"""The loop on a real vehicle: check, compare, diagnose, add, step by step, with `random-2` held out throughout.

    python experiments/beluga/run.py DATA [OUT] [--no-diagnosis] [--also=EFFECT ...]

DATA is the folder with Beluga's six CSV files, OUT where the answers go; each EFFECT is a further step to be tried.
What is kept is decided on fitted runs that are left out in turn; `random-2` is only judged on.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import numpy as np
import torch
from glitches import without_glitches

from auvnn.answers import plain
from auvnn.comparison import compare
from auvnn.diagnosis import diagnose
from auvnn.improvement import add
from auvnn.logs import Log, Run
from auvnn.models import GreyBox, load

HERE = Path(__file__).parent
FITTED = ("surge-1", "sway-1", "heave-1", "yaw-1", "random-1")
HELD_OUT = "random-2"
STEPS = ("cg_offset", "turning_forces", "thrust_overshoot", "tilted_vertical")
# Roll and pitch are driven in random-1 alone: it is fitted whole, of the others this much, s.
SECONDS = 100.0
FILTER = {"method": "local_polynomial", "half_width": 4, "order": 2}
# A diagnosis runs free over windows, which takes long: it gets the liveliest part of each run, s, and one name a time.
PIECES = {
    "surge-1": (80, 120),
    "sway-1": (80, 120),
    "heave-1": (60, 100),
    "yaw-1": (80, 120),
    "random-1": (460, 520),
}
WINDOW = 2.0


def read(data: Path, names: tuple[str, ...], mapping: str) -> Log:
    """Return runs of Beluga, one file each."""
    return Log.read([data / f"{n}.csv" for n in names], HERE / mapping)


def first(run: Run, seconds: float) -> Run:
    """Return the beginning of a run."""
    return run.cut(slice(0, int(np.searchsorted(run.t, run.t[0] + seconds))))


def lively(log: Log) -> Log:
    """Return the part of each fitted run that a diagnosis gets."""
    cut = []
    for run, (begin, end) in zip(log.runs, PIECES.values(), strict=True):
        cut.append(run.cut(slice(*np.searchsorted(run.t - run.t[0], [begin, end]))))
    return Log.from_runs(cut, name="beluga's lively parts")


def told(words: str, step: dict) -> dict:
    """Print and return held-out R2 one step ahead and the free-running error at 1, 2 and 5 s."""
    r2 = {k: v["r2"] for k, v in step["one_step"].items()}
    print(f"{words:<28} R2 " + " ".join(f"{v:6.2f}" for v in r2.values()), flush=True)
    rollout = {}
    for horizon, row in step["rollout"].items():
        by = {c: row[c]["nrmse"] for c in "uvwpqr"}
        channels = " ".join(f"{np.nan if v is None else v:6.2f}" for v in by.values())
        print(
            f"{'':<22}{horizon:>3} s    {channels}  total {row['total']:.3f}  persistence {row['persistence']:.3f}"
        )
        rollout[horizon] = {"total": row["total"], "persistence": row["persistence"], **by}
    return {"r2": r2, "rollout": rollout}


def name_what_is_missing(model: GreyBox, log: Log, out: Path) -> dict:
    """Diagnose by cross-validation over parts of the fitted runs, and keep the answer."""
    found = diagnose(model, lively(log), max_effects=1, window=WINDOW)
    found.write(out)
    first = found.candidates[0] if found.candidates else None
    words = f"diagnose: {found.verdict} {' or '.join(found.missing) or '(nothing named)'}"
    if first is not None:
        words += (
            f"; best {first['effect']}, runs left out {first['cv_before']:.3f} -> {first['cv_after']:.3f}"
        )
    print(f"{'':<28} {words}", flush=True)
    ranking = [
        {k: c[k] for k in ("effect", "p_value", "explained", "cv_before", "cv_after")}
        for c in found.candidates
    ]
    return {
        "verdict": found.verdict,
        "missing": found.missing,
        "depends_on": found.depends_on,
        "ranking": ranking,
    }


def main() -> None:
    """Go the whole way and write `result.json`."""
    torch.set_num_threads(1)
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    data, out = Path(arguments[0]), Path(arguments[1] if len(arguments) > 1 else "outputs/beluga")
    began, result = time.monotonic(), {}

    quality = read(data, FITTED, "mapping-raw.yaml").quality()
    result["reversed"] = [n for n, k in quality.kinematics.items() if k.scale is not None and k.scale < 0]
    result["late"] = {n: k.lag for n, k in quality.kinematics.items()}
    print(
        "check, signs as logged: reversed against the attitude's derivative:", ", ".join(result["reversed"])
    )
    print(
        "check, late against attitude and position, s:", {n: round(v, 3) for n, v in result["late"].items()}
    )

    log, doubtful = without_glitches(read(data, FITTED, "mapping.yaml"))
    test, _ = without_glitches(read(data, (HELD_OUT,), "mapping.yaml"))
    print("poses that contradict the velocities, left out (attitude, position) by run:", doubtful)
    log = Log.from_runs([*(first(r, SECONDS) for r in log.runs[:-1]), log.runs[-1]], name="beluga")
    model = load(HERE / "beluga.yaml", actuation="wrench")
    diagnosing = "--no-diagnosis" not in sys.argv

    if diagnosing:
        compare(model, test, derivative=FILTER).write(out / "compare")
    answer = add(
        model,
        log,
        (*STEPS, *(a.removeprefix("--also=") for a in sys.argv if a.startswith("--also="))),
        test=test,
        derivative=FILTER,
        objective="one_step",
        horizons=("1", "2", "5"),
        progress=lambda w: print("   ", w, round(time.monotonic() - began), flush=True),
    )
    answer.write(out / "add")
    for number, step in enumerate(answer.steps):
        words = step["step"] if number < 2 else f"+ {step['step']}"
        result[words] = told(words, step)
        if step["left_out"] is None:
            continue
        # Parts left out of the fitted runs decide; what the held-out log says of it decides nothing.
        result[words].update(left_out=step["left_out"])
        for by, left in step["left_out"].items():
            verdict = "pays" if left["gain"] > left["std"] else "does not pay"
            print(
                f"{'':<28} {by} left out {left['before']:.4f} -> {left['after']:.4f} (+- {left['std']:.4f}): {verdict}",
                flush=True,
            )
    result["parameters"], result["coefficients"] = answer.parameters, answer.coefficients
    result["warnings"], result["seconds"] = answer.warnings, time.monotonic() - began
    answer.model.save(out / "model", overwrite=True)
    save(out, result)
    if diagnosing:
        for number, step in enumerate(answer.steps):
            found = name_what_is_missing(step["model"], log, out / f"diagnose-{number}")
            result[step["step"] if number < 2 else f"+ {step['step']}"]["diagnosis"] = found
            save(out, result)
    result["seconds"] = time.monotonic() - began
    save(out, result)


def save(out: Path, result: dict) -> None:
    """Write what is known so far."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "result.json").write_text(json.dumps(plain(result), indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
