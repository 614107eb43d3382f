"""How time and memory of what is done in parts grow with the number of samples.

    python experiments/benchmarks/growth.py [sizes=1e4,1e5,1e6] [what=read,sums,train,diagnose] [folder=...] [workers=1]

Makes logs of a remotely operated vehicle in a hidden current at 20 Hz (one simulated hour, repeated as runs with fresh
noise), and measures in a process of its own for each size

    read      one pass through the file that finds all windows of free running,
    sums      that, and one pass over all windows: initial states settled, sums towards the uncertain coefficients,
    train     `train_files` with its defaults, from a vehicle of which no damping is known: six networks until they have
              converged or the held-out run says stop,
    trainN    the same for N iterations of one starting point (train20), so that every size does the same per sample,
    diagnose  `diagnose_files` with its defaults (search on 240 windows, tests and fit on 1000) and six candidates.

Processor time (user and system) is what grows; wall-clock time is printed beside it. Peak memory is the process's own
(`ru_maxrss`), Python, torch and the vehicle included. The slope is that of log(time) over log(samples) between the
last two sizes: 1 is linear. Needs pyarrow, which writes the logs chunk by chunk.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

RATE, RUN, RUNS = (
    20.0,
    6000,
    12,
)  # samples per second, samples of a run, and runs of the hour that is repeated
NOISE = {**dict.fromkeys("uvw", 0.003), **dict.fromkeys("pqr", 0.001)}  # m/s, rad/s
CANDIDATES = ["ocean_current", "net_buoyancy", "cg_offset", "constant_force", "thruster_lag", "body_lift"]


def make(samples: int, path: Path) -> None:
    """Write a log of so many samples, an hour at a time."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    import auvnn

    made = auvnn.simulate(
        auvnn.load("rov90", actuation="wrench"), "multisine", hidden={"ocean_current": {"v_north": 0.2, "v_east": -0.1}},
        duration=(RUN - 1) / RATE, rate=RATE, runs=min(RUNS, -(-samples // RUN)), max_step=0.05, noise="none",
    )  # fmt: skip
    base = [{name: np.array(column) for name, column in run.columns()} for run in made.log.runs]
    rng = np.random.default_rng(0)
    writer, done, number = None, 0, 0
    while done < samples:
        hour = []
        for columns in base:
            rows = min(RUN, samples - done)
            if rows < 100:
                break
            number, done = number + 1, done + rows
            table = {
                "run": np.full(rows, number),
                **{name: column[:rows].copy() for name, column in columns.items()},
            }
            for name, noise in NOISE.items():
                table[name] += rng.normal(scale=noise, size=rows)
            hour.append(pa.table(table))
        if not hour:
            break
        chunk = pa.concat_tables(hour).combine_chunks()
        writer = writer or pq.ParquetWriter(path, chunk.schema)
        writer.write_table(chunk, row_group_size=50_000)
    assert writer is not None
    writer.close()


def measure(what: str, path: Path, workers: int) -> dict[str, float]:
    """Measure one thing in this process."""
    import torch

    torch.set_num_threads(1)
    import auvnn
    from auvnn.diagnosis.full_data.map_reduce import LinearisationPoint, MapReduce
    from auvnn.diagnosis.hypotheses.stated_priors import lay_out
    from auvnn.effects import Extent
    from auvnn.executors import executor_for
    from auvnn.log_chunks.scan import WindowCut
    from auvnn.log_chunks.windows import plan_files
    from auvnn.logs.reading.mapping_file.mapping import Mapping

    model = auvnn.load("rov90", actuation="wrench")
    begin, cpu = time.perf_counter(), _cpu()
    windows = 0
    if what.startswith("train"):
        vehicle = replace(model.vehicle, linear_damping=None, quadratic_damping=None)
        scheme: dict[str, Any] = {"scheme": "levenberg_marquardt"}
        if what != "train":
            count = int(what.removeprefix("train"))
            scheme |= {"max_iterations": count, "restarts": 1, "tolerance": 0.0, "patience": 1000}
        trained = auvnn.train_files(auvnn.GreyBox(vehicle, actuation="wrench"), path, scheme, workers=workers)
        windows = trained.metrics["iterations"]
    elif what == "diagnose":
        found = auvnn.diagnose_files(model, path, CANDIDATES, max_effects=1, advice=False, workers=workers)
        assert found.whole_log is not None
        windows = found.whole_log["looked_at"]
    else:
        cut = WindowCut(5.0, 3.0, "wrench", Mapping.read(None))
        plan = plan_files([path], cut)
        windows = plan.windows
        if what == "sums":
            layout = lay_out(model, [])
            sigma = np.full(18, np.inf)
            sigma[:12] = [0.05] * 3 + [0.005] * 3 + [0.005] * 6
            point = LinearisationPoint(
                layout, (), Extent(0.0, 1.0, 1.0, (0.0, 0.0)), tuple(layout.names), sigma, cut, 1
            )
            with executor_for(workers=workers) as pool:
                MapReduce(pool, plan.parts).sums(point, "sums")
    memory = max(
        resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return {
        "seconds": time.perf_counter() - begin,
        "cpu": _cpu() - cpu,
        "megabytes": memory / 1024,
        "windows": windows,
    }


def _cpu() -> float:
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(r.ru_utime + r.ru_stime for r in both)


def main(arguments: list[str]) -> None:
    """Measure all sizes and print the table."""
    if arguments[:1] == ["measure"]:
        what, path, workers = arguments[1:]
        print(json.dumps(measure(what, Path(path), int(workers))))
        return
    options = dict(word.split("=", 1) for word in arguments)
    sizes = [int(float(s)) for s in options.get("sizes", "1e4,1e5,1e6").split(",")]
    wanted = options.get("what", "read,sums,diagnose").split(",")
    workers = options.get("workers", "1")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(options.get("folder", scratch))
        folder.mkdir(parents=True, exist_ok=True)
        print("| what | samples | windows or iterations | processor, s | wall, s | peak memory, MB | slope |")
        print("|---|---|---|---|---|---|---|")
        before: dict[str, tuple[int, float]] = {}
        for size in sizes:
            path = folder / f"growth-{size}.parquet"
            if not path.exists():
                make(size, path)
            for what in wanted:
                environment = {**os.environ, "OMP_NUM_THREADS": "1"}
                command = [sys.executable, __file__, "measure", what, str(path), workers]
                done = subprocess.run(command, capture_output=True, text=True, env=environment)
                if done.returncode != 0:
                    print(
                        f"| {what} | {size:.0e} | failed: {done.stderr.strip().splitlines()[-1]} |",
                        flush=True,
                    )
                    continue
                row = json.loads(done.stdout.splitlines()[-1])
                slope = ""
                if what in before:
                    last, took = before[what]
                    slope = f"{np.log(row['cpu'] / took) / np.log(size / last):.2f}"
                before[what] = (size, row["cpu"])
                print(
                    f"| {what} | {size:.0e} | {row['windows']} | {row['cpu']:.1f} | {row['seconds']:.1f} | "
                    f"{row['megabytes']:.0f} | {slope} |",
                    flush=True,
                )


if __name__ == "__main__":
    main(sys.argv[1:])
