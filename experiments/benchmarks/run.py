"""Everything that is claimed about speed, measured side by side in one process with one thread.

    python experiments/benchmarks/run.py OUT [only=free,windows,many,training,imports,compile,slopes] [repeats=20]
        [seeds=10]

Prints tables and writes OUT/benchmarks.json. Peers that are not installed are skipped, and named.
"""

from __future__ import annotations

from alone import CACHE  # isort: skip  (before numpy and torch start their threads)

import json
import os
import platform
import sys
from pathlib import Path
from typing import Any

import torch
from imports import imports
from measure import once, table
from rollouts import Ours, agreement, free_runs, jax_peer, many, windows
from slopes import MOMENTS, slopes
from standard import Work, standard_work
from training import training

torch.set_num_threads(1)

PARTS = ("free", "windows", "many", "training", "imports", "compile", "slopes")


def machine() -> dict[str, Any]:
    """Return what the figures were measured on."""
    from importlib.metadata import PackageNotFoundError, version

    versions = {}
    for name in ("torch", "torchdiffeq", "jax", "jaxlib", "numpy", "scipy"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = None
    return {
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cores": os.cpu_count(),
        "load": os.getloadavg() if hasattr(os, "getloadavg") else None,
        "versions": versions,
    }


def compiling(work: Work) -> list[dict[str, Any]]:
    """Return what the first run costs more than the second, and from how many runs on that pays."""
    from auvnn.models import model_kernels

    found = []
    for name, call in (("free run", "run"), ("free run and gradient", "run_and_gradient")):
        model_kernels._KERNELS.clear()
        model_kernels._MADE.clear()
        for kept in Path(CACHE).glob("*.so"):
            kept.unlink()
        ours, plain = Ours(work, "compiled"), Ours(work, "torch")
        first = once(getattr(ours, call))[0]
        model_kernels._KERNELS.clear()
        model_kernels._MADE.clear()
        kept_already = once(getattr(ours, call))[0]
        second = min(once(getattr(ours, call))[0] for _ in range(5))
        torch_s = once(getattr(plain, call))[0]
        found.append(
            {
                "name": name,
                "first_call_s": first,
                "first_call_with_kept_code_s": kept_already,
                "later_calls_s": second,
                "plain_torch_s": torch_s,
                "pays_from_run": int(first / max(torch_s - second, 1e-9)) + 1,
            }
        )
    return found


def main(out: str, *options: str) -> None:
    """Measure and write."""
    given = dict(o.split("=", 1) for o in options)
    only = given.get("only", ",".join(PARTS)).split(",")
    unknown = [p for p in only if p not in PARTS]
    if unknown:
        sys.exit(f"only={unknown[0]}: choose from {', '.join(PARTS)}")
    repeats, seeds = int(given.get("repeats", 20)), int(given.get("seeds", 10))
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    answer: dict[str, Any] = {"machine": machine()}
    rolling = {"free", "windows", "many", "compile"} & set(only)
    if rolling or "training" in only:
        work = standard_work()
    if rolling:
        peer = jax_peer(work)
        answer["agreement"] = agreement(work, peer)
        print(f"agreement with ours: {answer['agreement']}\n", flush=True)
    if "free" in only:
        answer |= free_runs(work, peer, repeats)
        for name in ("free run", "free run and gradient"):
            print(table(name, answer[name]), flush=True)
    if "windows" in only:
        answer["windows"] = windows(work, peer, repeats)
        print(table("150 windows of 20 steps, and gradient", answer["windows"]), flush=True)
    if "many" in only:
        answer["many"] = many(work, peer, max(2, repeats // 10))
        print(table("1024 free runs at once", answer["many"]), flush=True)
    for name, measured in (("training", training), ("compile", compiling)):
        if name in only:
            answer[name] = measured(work, seeds) if name == "training" else measured(work)
            print(f"### {name}\n", *(f"{row}" for row in answer[name]), "", sep="\n", flush=True)
    if "slopes" in only:
        answer["slopes"] = found = slopes(repeats)
        title = f"slopes of the acceleration at {MOMENTS} moments in state, thrust and {found['parameters']} parameters"
        print(
            table(title, found["rows"]),
            f"largest difference {found['difference']:.1g}\n",
            sep="\n",
            flush=True,
        )
    if "imports" in only:
        answer["imports"] = imports(max(3, repeats // 4))
        print("### imports\n", *(f"{row}" for row in answer["imports"]), "", sep="\n", flush=True)
    (folder / "benchmarks.json").write_text(json.dumps(answer, indent=1) + "\n", encoding="utf-8")
    print(f"written: {folder / 'benchmarks.json'}")


if __name__ == "__main__":
    if len(sys.argv) < 2 or "=" in sys.argv[1]:
        sys.exit(__doc__)
    main(*sys.argv[1:])
