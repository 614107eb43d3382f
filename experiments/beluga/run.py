"""The loop on a real vehicle: check, compare, diagnose, add, step by step, with `random-2` held out throughout.

    python experiments/beluga/run.py DATA [OUT] [SECONDS] [--no-diagnosis]

DATA is the folder with Beluga's six CSV files, OUT where the answers go, SECONDS how much of each run is fitted.
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
from auvnn.diagnosis import add, compare, diagnose
from auvnn.logs import Log
from auvnn.metrics.one_step import choose_derivative, one_step, scores
from auvnn.metrics.rollouts import scale_of, table
from auvnn.models import load

HERE = Path(__file__).parent
FITTED = ("surge-1", "sway-1", "heave-1", "yaw-1", "random-1")
HELD_OUT = "random-2"
STEPS = ("thruster_gain", "cg_offset", "net_buoyancy", "thruster_lag", "velocity_lever_arm", "constant_force")
# Waves off the walls and held samples, not sensors, limit the prediction here: two seconds, chosen on the fitted runs.
WINDOW = 2.0
FILTER = {"method": "local_polynomial", "half_width": 4, "order": 2}


def read(data: Path, names: tuple[str, ...], mapping: str) -> Log:
    """Return runs of Beluga, one file each."""
    return Log.read([data / f"{n}.csv" for n in names], HERE / mapping)


def judge(words: str, model, test: Log) -> dict:
    """Print and return held-out R2 one step ahead and the free-running error at 1, 2 and 5 s."""
    one = scores(one_step(model, test, choose_derivative(test, FILTER)))
    rolled = table(model, test, scale_of(test), ("1", "2", "5"))[0]
    r2 = {k: one[k]["r2"] for k in one}
    print(f"{words:<28} R2 " + " ".join(f"{v:6.2f}" for v in r2.values()), flush=True)
    for horizon, row in rolled.items():
        channels = " ".join(
            f"{row[c]['nrmse'] if row[c]['nrmse'] is not None else np.nan:6.2f}" for c in "uvwpqr"
        )
        print(
            f"{'':<22}{horizon:>3} s    {channels}  total {row['total']:.3f}  persistence "
            f"{row['persistence']:.3f}",
            flush=True,
        )
    return {
        "r2": r2,
        "rollout": {
            h: {
                "total": row["total"],
                "persistence": row["persistence"],
                **{c: row[c]["nrmse"] for c in "uvwpqr"},
            }
            for h, row in rolled.items()
        },
    }


def name_what_is_missing(model, log: Log, out: Path, result: dict) -> None:
    """Diagnose by cross-validation over the fitted runs, and keep the answer."""
    found = diagnose(model, log, max_effects=3, window=WINDOW, progress=lambda w: print("   ", w, flush=True))
    found.write(out / "diagnose")
    for line in found.story:
        print("diagnose:", line, flush=True)
    result["diagnosis"] = {
        "verdict": found.verdict,
        "missing": found.missing,
        "steps": found.steps,
        "ranking": [
            {k: c[k] for k in ("effect", "p_value", "explained", "cv_before", "cv_after", "parameters")}
            for c in found.candidates
        ],
    }
    save(out, result)


def main() -> None:
    """Go the whole way and write `result.json`."""
    torch.set_num_threads(1)
    data = Path(sys.argv[1])
    out = Path(sys.argv[2] if len(sys.argv) > 2 else "outputs/beluga")
    seconds = float(sys.argv[3]) if len(sys.argv) > 3 else np.inf
    began, result = time.monotonic(), {}

    raw = read(data, FITTED, "mapping-raw.yaml")
    quality = raw.quality()
    result["reversed"] = [n for n, k in quality.kinematics.items() if k.scale is not None and k.scale < 0]
    print(
        "check, signs as logged: reversed against the attitude's derivative:", ", ".join(result["reversed"])
    )

    log, doubtful = without_glitches(read(data, FITTED, "mapping.yaml"))
    test, _ = without_glitches(read(data, (HELD_OUT,), "mapping.yaml"))
    print("poses that contradict the velocities, left out (attitude, position) by run:", doubtful)
    log = Log.from_runs(
        [r.cut(slice(0, int(np.searchsorted(r.t, r.t[0] + seconds)))) for r in log.runs], name="beluga"
    )
    model = load(HERE / "beluga.yaml", actuation="thrusters")

    result["as given"] = judge("as given", model, test)
    compare(model, test, derivative=FILTER).write(out / "compare")
    if "--no-diagnosis" not in sys.argv:
        name_what_is_missing(model, log, out, result)
    for number, effect in enumerate(STEPS, start=1):
        answer = add(model, log, effect, test=test, derivative=FILTER, window=WINDOW)
        if number == 1:
            result["coefficients refitted"] = judge("coefficients refitted", answer.refitted_model, test)
        words = f"+ {effect}"
        result[words] = judge(words, answer.model, test)
        result[words].update(gain=answer.gain, accepted=answer.accepted, parameters=answer.parameters)
        print(
            f"{'':<28} over the same model refitted without it: {answer.gain['value']:.3f} +- "
            f"{answer.gain['std']:.3f}, {'kept' if answer.accepted else 'not kept'}",
            flush=True,
        )
        answer.write(out / f"add-{number}-{effect}")
        if answer.accepted:
            # The next effect has to pay on top of what this one explains.
            model = answer.model
        result["seconds"] = time.monotonic() - began
        save(out, result)
    model.save(out / "model", overwrite=True)


def save(out: Path, result: dict) -> None:
    """Write what is known so far."""
    out.mkdir(parents=True, exist_ok=True)
    (out / "result.json").write_text(json.dumps(plain(result), indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
