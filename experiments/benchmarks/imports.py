"""What importing costs beyond torch, each in a fresh interpreter."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from typing import Any

PUBLIC = "import auvnn; [getattr(auvnn, n) for n in auvnn.__all__]"
CASES = {
    "python alone": ["-c", "pass"],
    "import torch": ["-c", "import torch"],
    "import auvnn": ["-c", "import auvnn"],
    "import torch, auvnn": ["-c", "import torch, auvnn"],
    "import torch, auvnn.models": ["-c", "import torch, auvnn.models"],
    "every public name of auvnn": ["-c", PUBLIC],
    "auvnn --help": ["-m", "auvnn", "--help"],
}


def _once(arguments: list[str]) -> tuple[float, float]:
    import resource

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = time.perf_counter()
    subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
    wall = time.perf_counter() - wall
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def imports(repeats: int) -> list[dict[str, Any]]:
    """Return seconds per case, and whether help does without torch."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in CASES}
    for name in CASES:
        _once(CASES[name])  # files into the system's cache, bytecode written
    for _ in range(repeats):
        for name, arguments in CASES.items():
            taken[name].append(_once(arguments))
    found = []
    for name, rows in taken.items():
        row = {
            "name": name,
            "cpu_s": statistics.median(c for _, c in rows),
            "wall_s": statistics.median(w for w, _ in rows),
            "best_wall_s": min(w for w, _ in rows),
        }
        found.append(row)
    code = (
        "import sys, runpy\nsys.argv = ['auvnn', '--help']\n"
        "try:\n    runpy.run_module('auvnn', run_name='__main__')\nexcept SystemExit:\n    pass\n"
        "sys.exit('torch' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.DEVNULL, check=False)
    found.append({"name": "auvnn --help does without torch", "true": done.returncode == 0})
    return found
