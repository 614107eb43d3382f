"""What a diagnosis with the whole catalogue costs, each in a process of its own, beside one pysindy fit.

    python experiments/benchmarks/diagnosis.py [OUT.json] [minutes=10] [rate=20] [threads=0] [repeats=3]

The log is of `rov95` under the multisine with realistic noise, in four runs, with nothing hidden or with a current. Wall
clock and processor seconds are those of the call of `diagnose`, memory is the process's largest, imports and log in it.
The peer is one fit of pysindy with a bootstrap ensemble of 100 (STLSQ, polynomials to second order in velocity,
commanded wrench and direction of the vertical) to the residual accelerations of the same log; it gives no names.
`threads=0` is one for each core.
"""

from __future__ import annotations

import json
import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

HIDDEN: dict[str, dict[str, dict[str, float]]] = {
    "nothing": {},
    "a current": {"ocean_current": {"v_north": 0.05, "v_east": 0.02}},
}


def logged(hidden: str, minutes: float, rate: float) -> tuple[Any, Any]:
    """Return model and log."""
    from auvnn.models import load
    from auvnn.simulation import simulate

    model = load("rov95")
    made = simulate(
        model, "multisine", "realistic", HIDDEN[hidden], seed=7, runs=4, duration=15.0 * minutes, rate=rate,
        max_step=0.025,
    )  # fmt: skip
    return model, made.log


def timed(call: Any) -> tuple[Any, dict[str, float]]:
    """Return what a call answers, and its seconds."""
    wall, processor = time.perf_counter(), time.process_time()
    answer = call()
    return answer, {"wall_s": time.perf_counter() - wall, "processor_s": time.process_time() - processor}


def diagnosis(hidden: str, minutes: float, rate: float) -> dict[str, Any]:
    """Diagnose in this process."""
    from auvnn.diagnosis import diagnose

    model, log = logged(hidden, minutes, rate)
    found, seconds = timed(lambda: diagnose(model, log))
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    return {"answer": [found.verdict, *found.missing], **seconds, "memory_mb": memory}


def peer(hidden: str, minutes: float, rate: float) -> dict[str, Any]:
    """Fit pysindy in this process."""
    try:
        import pysindy
    except ImportError:
        return {"answer": ["skipped: pip install pysindy"]}
    import numpy as np

    from auvnn.metrics.derivative import choose_derivative
    from auvnn.metrics.one_step import one_step

    model, log = logged(hidden, minutes, rate)
    parts = one_step(model, log, choose_derivative(log))
    states, gaps = [], []
    for run, part in zip(log.runs, parts, strict=True):
        w, x, y, z = run.quaternion.T
        down = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
        wrench = run.thrusters @ model.actuators.allocation.numpy().T
        rows, gap = np.concatenate([run.nu, wrench, down], axis=1), part.measured - part.model
        good = np.isfinite(rows).all(1) & np.isfinite(gap).all(1)
        states.append(rows[good])
        gaps.append(gap[good])
    optimizer = pysindy.EnsembleOptimizer(pysindy.STLSQ(threshold=1e-3), bagging=True, n_models=100)
    names = [*"uvwpqr", *(f"tau_{a}" for a in "XYZKMN"), "d_x", "d_y", "d_z"]
    # pysindy wants as many derivatives as states: those of the rest are zero.
    still = [np.concatenate([g, np.zeros((len(g), 9))], axis=1) for g in gaps]
    fit = pysindy.SINDy(optimizer=optimizer, feature_library=pysindy.PolynomialLibrary(degree=2))
    _, seconds = timed(lambda: fit.fit(states, 1.0 / rate, x_dot=still, feature_names=names))
    return {"answer": [f"{len(fit.get_feature_names())} terms"], **seconds,
            "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3}  # fmt: skip


def main(*words: str) -> None:
    """Measure and print."""
    given = dict(w.split("=", 1) for w in words if "=" in w)
    minutes, rate = float(given.get("minutes", 10)), float(given.get("rate", 20))
    threads = int(given.get("threads", 0)) or os.cpu_count() or 1
    environment = {**os.environ, "OMP_NUM_THREADS": str(threads)}
    rows = []
    print("| hidden | what | answer | wall, s | processor, s | memory, MB |\n|---|---|---|---|---|---|")
    for hidden in HIDDEN:
        for what in ("diagnosis", "peer"):
            found = []
            for _ in range(int(given.get("repeats", 3))):
                child = [sys.executable, __file__, "--child", what, hidden, str(minutes), str(rate)]
                done = subprocess.run(child, env=environment, check=True, capture_output=True, text=True)
                found.append(json.loads(done.stdout.splitlines()[-1]))
            row: dict[str, Any] = {
                "hidden": hidden,
                "what": what,
                "answer": found[0]["answer"],
                "repeats": found,
            }
            for key in ("wall_s", "processor_s", "memory_mb"):
                row[key] = statistics.median(f[key] for f in found) if key in found[0] else None
            rows.append(row)
            shown = ["–" if row[k] is None else f"{row[k]:.{d}f}" for k, d in
                     (("wall_s", 1), ("processor_s", 1), ("memory_mb", 0))]  # fmt: skip
            print(f"| {hidden} | {what} | {' '.join(row['answer'])} | {' | '.join(shown)} |", flush=True)
    files = [w for w in words if "=" not in w]
    if files:
        kept = {"minutes": minutes, "rate": rate, "threads": threads, "load": os.getloadavg(), "rows": rows}
        Path(files[0]).write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--child"]:
        what, hidden, minutes, rate = sys.argv[2:]
        measured = (diagnosis if what == "diagnosis" else peer)(hidden, float(minutes), float(rate))
        print(json.dumps(measured))
    else:
        main(*sys.argv[1:])
