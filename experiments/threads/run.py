"""How many threads pay, command by command: unset, one, two, side by side in one run, idle and on a busy machine.

    python experiments/threads/run.py OUT [--only=compare,train] [--repeats=3] [--seconds=40] [--conditions=alone,busy]

Each command runs as its user runs it, in a process of its own, in turn with OMP_NUM_THREADS unset, 1 and 2, so that
what else the machine does falls on all settings alike; then again beside one busy process per core. A third condition,
`given`, starts nothing: it is for a machine that other work keeps busy. The figure is the least wall time of the
repeats. A command passes where, unset, it takes at most 1.2 times its best setting.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

SETTINGS = ("unset", "1", "2")
# Unset may take so many times the best setting.
ALLOWED = 1.2
BUSY = "while True: pass"
CONDITIONS = ("alone", "busy", "given")
MODEL = "rov95"
# What numerical libraries read; a measurement begins without any of them.
NAMES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_WAIT_POLICY", "KMP_BLOCKTIME")


def commands(folder: Path) -> dict[str, list[str]]:
    """Return the arguments of each command, on logs that lie in a folder."""
    log, dives = str(folder / "log.parquet"), str(folder / "dives")
    return {
        "simulate": [f"model={MODEL}", "runs=2", "duration=40"],
        "check": [f"log={log}", f"model={MODEL}"],
        "compare": [f"log={log}", f"model={MODEL}"],
        "diagnose": [
            f"log={log}",
            f"model={MODEL}",
            "effects=[ocean_current,net_buoyancy,quadratic_damping]",
        ],
        "add": [f"log={log}", f"model={MODEL}", "effect=ocean_current"],
        "improve": [
            f"log={log}",
            f"model={MODEL}",
            "diagnosing=false",
            "effects=[ocean_current,net_buoyancy]",
        ],
        "train": [f"log={log}", f"model={MODEL}", "scheme.max_iterations=60"],
        "adapt": [f"log={log}", f"model={MODEL}"],
        "fleet": [f"log={dives}", f"model={MODEL}", "effects=[ocean_current]"],
    }


def environment(setting: str) -> dict[str, str]:
    """Return the environment of a setting: nothing else that counts threads is set."""
    own = {k: v for k, v in os.environ.items() if k not in NAMES}
    return own if setting == "unset" else {**own, "OMP_NUM_THREADS": setting}


def timed(verb: str, arguments: list[str], setting: str, out: Path) -> float:
    """Run a command once and return its wall time, s."""
    line = [sys.executable, "-m", "auvnn", verb, *arguments, f"out={out}", "overwrite=true"]
    began = time.perf_counter()
    done = subprocess.run(line, env=environment(setting), capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{verb} with {setting} threads ended with {done.returncode}: {done.stderr[-500:]}")
    return time.perf_counter() - began


@contextmanager
def busy(count: int):
    """Keep so many processes busy."""
    others = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for process in others:
            process.kill()
            process.wait()


def measured(chosen: dict[str, list[str]], folder: Path, repeats: int) -> dict[str, dict[str, list[float]]]:
    """Return all wall times, by command and setting; settings take turns."""
    out = {verb: {s: [] for s in SETTINGS} for verb in chosen}
    for verb, arguments in chosen.items():
        for k in range(repeats):
            for j in range(len(SETTINGS)):
                setting = SETTINGS[(j + k) % len(SETTINGS)]
                out[verb][setting].append(timed(verb, arguments, setting, folder / "out"))
        print(f"{verb:<9} {judged(out[verb])}", flush=True)
    return out


def judged(times: dict[str, list[float]]) -> dict[str, float | bool]:
    """Return the least time of each setting, the ratio of unset to the best of them, and whether that passes."""
    least = {s: min(t) for s, t in times.items()}
    ratio = least["unset"] / min(least.values())
    return {
        **{s: round(t, 2) for s, t in least.items()},
        "ratio": round(ratio, 3),
        "passes": ratio <= ALLOWED,
    }


def prepared(folder: Path, seconds: float) -> None:
    """Make the logs that are measured on."""
    (folder / "dives").mkdir(parents=True, exist_ok=True)
    for seed, path in enumerate(
        (folder / "log.parquet", folder / "dives/1.parquet", folder / "dives/2.parquet")
    ):
        line = [
            "simulate",
            f"model={MODEL}",
            "runs=3",
            f"duration={seconds}",
            f"seed={seed}",
            "noise=realistic",
        ]
        made = folder / "made"
        subprocess.run(
            [sys.executable, "-m", "auvnn", *line, "hidden=[ocean_current]", f"out={made}", "overwrite=true"],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        (made / "log.parquet").replace(path)


def main() -> None:
    """Measure idle and busy, and write `threads.json`."""
    given = {k: v for k, _, v in (a[2:].partition("=") for a in sys.argv[1:] if a.startswith("--"))}
    (folder,) = [Path(a) for a in sys.argv[1:] if not a.startswith("--")]
    folder = folder.resolve()
    prepared(folder, float(given.get("seconds", 40)))
    chosen = commands(folder)
    if "only" in given:
        chosen = {verb: chosen[verb] for verb in given["only"].split(",")}
    repeats, cores = int(given.get("repeats", 3)), os.cpu_count() or 1
    answer = {"cores": cores, "load_before": os.getloadavg(), "repeats": repeats}
    conditions = given.get("conditions", "alone,busy").split(",")
    if not {*conditions} <= {*CONDITIONS}:
        raise SystemExit(f"--conditions={given['conditions']}: choose from {', '.join(CONDITIONS)}")
    for condition in conditions:
        print(f"{condition}: seconds by OMP_NUM_THREADS", flush=True)
        with busy(cores if condition == "busy" else 0):
            times = measured(chosen, folder, repeats)
        answer[condition] = {verb: judged(t) for verb, t in times.items()}
    answer["load_after"] = os.getloadavg()
    (folder / "threads.json").write_text(json.dumps(answer, indent=1), encoding="utf-8")
    slow = [f"{c}: {v}" for c in conditions for v, r in answer[c].items() if not r["passes"]]
    print("all pass" if not slow else f"slower than allowed: {', '.join(slow)}")


if __name__ == "__main__":
    main()
