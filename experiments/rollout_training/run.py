"""One-step training against training on free running, on the same data, with noise and without.

    python experiments/rollout_training/run.py [OUT] [--seeds 0,1,...] [--noises paper,realistic,none] [--small]

Every finished seed is kept in OUT/rows.json, so that a study that was interrupted goes on where it stood.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch

from auvnn.answers import plain, write_text
from auvnn.logs import Log
from auvnn.metrics.rollouts import roll, scale_of
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate
from auvnn.training import train

VEHICLE, EXCITATION, RATE, RUNS, DURATION = "rov95", "multisine", 10.0, 4, 20.0
TEST_SEED = 1000
# What is trained, by name: options of `train`.
WAYS: dict[str, dict[str, Any]] = {
    "one_step": {},
    "one_step_estimated": {"derivative": {"method": "local_polynomial"}},
    "rollout": {"objective": {"objective": "rollout", "window": 4.0, "iterations": 6}},
    "rollout_torchdiffeq": {"objective": {"objective": "rollout_torchdiffeq", "window": 4.0, "epochs": 15}},
    "rollout_given": {
        "objective": {"objective": "rollout", "window": 4.0, "iterations": 6, "start": "given"}
    },
}
# What is done, in this order, so that a study that is cut short has told the most. Where no acceleration is
# measured, the one-step fit is on estimated ones anyway.
PASSES = (
    ("paper", ("one_step", "one_step_estimated", "rollout")),
    ("realistic", ("one_step", "rollout")),
    ("paper", ("rollout_torchdiffeq",)),
    ("realistic", ("rollout_torchdiffeq",)),
    ("none", ("one_step", "rollout", "rollout_torchdiffeq")),
    ("paper", ("rollout_given",)),
)
WAYS_SMALL = {"rollout": {"iterations": 2}, "rollout_torchdiffeq": {"epochs": 4}}


def without_damping(model: GreyBox) -> GreyBox:
    """Return the model of one who knows nothing of the vehicle's damping: the paper's case."""
    bare = replace(model.vehicle, damping_elements=(), linear_damping=None, quadratic_damping=None)
    return GreyBox(bare, actuation=model.actuation)


def made(noise: str, seed: int, runs: int, duration: float) -> Log:
    """Return a simulated log of the vehicle with its damping."""
    how = {"runs": runs, "duration": duration, "rate": RATE, "max_step": 0.05}
    return simulate(load(VEHICLE), EXCITATION, noise, None, seed, **how).log


def judged(model: GreyBox, test: Log) -> dict[str, float | None]:
    """Return held-out free running: 5 s windows, and the whole run over the range of each velocity, worst first."""
    scale = scale_of(test)
    windows, whole = roll(model, test, "5", scale), roll(model, test, "full", scale)
    assert windows is not None and whole is not None
    reach = np.ptp(np.concatenate([run.nu for run in test.runs]), axis=0)
    rmse = np.sqrt(whole.squared.sum(0) / whole.count.sum(0))
    return {
        "total_5s": windows.total(scale),
        "rmse_over_range": float((rmse / reach).max()),
        "diverged": int(whole.diverged.sum()),
    }


def some(noise: str, seed: int, ways: tuple[str, ...], small: bool) -> list[dict[str, Any]]:
    """Train in some ways on one log and judge each on the plant's noise-free motion, held out."""
    runs, duration = (3, 20.0) if small else (RUNS, DURATION)
    log = made(noise, seed, runs, duration)
    test = made("none", TEST_SEED + seed, 2, 20.0)
    rows = []
    for way in ways:
        began = time.perf_counter()
        options = dict(WAYS[way])
        if small and "objective" in options:
            options["objective"] = {**options["objective"], "window": 2.0, **WAYS_SMALL.get(way, {})}
        found = train(without_damping(load(VEHICLE)), log, test=test, seed=seed, **options)
        row = {"noise": noise, "seed": seed, "way": way, "seconds": time.perf_counter() - began}
        row |= judged(found.model, test)
        rows.append({**row, "start": found.history.get("rollout", {}).get("start"), "stopped": found.stopped})
        print(f"{noise:<10} seed {seed}  {way:<20} 5 s {row['total_5s']:.4f}  worst over range "
              f"{row['rmse_over_range']:.4f}  ({row['seconds']:.0f} s)", flush=True)  # fmt: skip
    return rows


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return medians over seeds, and by how much each way divides the error of the one-step fit."""
    out: dict[str, Any] = {}
    for noise in dict.fromkeys(r["noise"] for r in rows):
        first = {r["seed"]: r for r in rows if r["noise"] == noise and r["way"] == "one_step"}
        table = {}
        for way in WAYS:
            mine = [r for r in rows if r["noise"] == noise and r["way"] == way]
            if not mine:
                continue
            entry: dict[str, Any] = {"seeds": len(mine)}
            for key in ("total_5s", "rmse_over_range"):
                entry[key] = median(r[key] for r in mine)
                entry[f"{key}_divided_by"] = median(first[r["seed"]][key] / r[key] for r in mine)
            entry["seconds"] = median(r["seconds"] for r in mine)
            table[way] = entry
        out[noise] = table
    return out


def main() -> None:
    """Run the study and print medians."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", nargs="?", default="outputs/rollout_training")
    parser.add_argument("--seeds", default=",".join(map(str, range(10))))
    parser.add_argument("--noises", default="paper,realistic,none")
    parser.add_argument(
        "--small", action="store_true", help="little data and few steps: seconds, not minutes"
    )
    given = parser.parse_args()
    torch.set_num_threads(1)
    kept = Path(given.out) / "rows.json"
    rows = json.loads(kept.read_text()) if kept.exists() else []
    for noise, ways in PASSES:
        for seed in (int(s) for s in given.seeds.split(",")):
            done = {r["way"] for r in rows if r["noise"] == noise and r["seed"] == seed}
            left = tuple(way for way in ways if way not in done)
            if left and noise in given.noises.split(","):
                rows += plain(some(noise, seed, left, given.small))
                write_text(kept, json.dumps(rows, indent=1))
    found = plain(summary(rows))
    write_text(Path(given.out) / "summary.json", json.dumps(found, indent=1))
    for noise, table in found.items():
        print(f"\n{noise}: medians, held-out multisine")
        for way, entry in table.items():
            print(f"  {way:<20} 5 s {entry['total_5s']:.4f}   worst over "
                  f"range {entry['rmse_over_range']:.4f}   error divided by "
                  f"{entry['total_5s_divided_by']:.2f} and {entry['rmse_over_range_divided_by']:.2f}"
                  f"   {entry['seeds']} seeds, {entry['seconds']:.0f} s")  # fmt: skip


if __name__ == "__main__":
    main()
