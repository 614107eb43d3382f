"""The whole loop on a real vehicle by `auvnn.improve`, with its defaults; `random-2` is judged on once, at the end.

    python experiments/improve/run.py DATA [OUT] [--seconds=600] [--no-diagnosis]

DATA is the folder with the six CSV files of Beluga, OUT where the answer goes. Model, mapping, the runs that are
fitted and how much of them are those of `experiments/beluga`.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import torch

HERE = Path(__file__).parent
BELUGA = HERE.parent / "beluga"
sys.path.insert(0, str(BELUGA))

from glitches import without_glitches  # noqa: E402
from run import FITTED, HELD_OUT, SECONDS, first, read  # noqa: E402

import auvnn  # noqa: E402
from auvnn.answers import plain  # noqa: E402
from auvnn.logs import Log  # noqa: E402
from auvnn.models import load  # noqa: E402


def main() -> None:
    """Walk the loop and write the answer, the model and `result.json`."""
    torch.set_num_threads(1)
    arguments = [a for a in sys.argv[1:] if not a.startswith("--")]
    limit = [float(a.partition("=")[2]) for a in sys.argv if a.startswith("--seconds=")]
    data, out = Path(arguments[0]), Path(arguments[1] if len(arguments) > 1 else "outputs/improve")
    log, _ = without_glitches(read(data, FITTED, "mapping.yaml"))
    test, _ = without_glitches(read(data, (HELD_OUT,), "mapping.yaml"))
    log = Log.from_runs([*(first(r, SECONDS) for r in log.runs[:-1]), log.runs[-1]], name="beluga")
    began = time.monotonic()

    def tell(words: str) -> None:
        print(f"{time.monotonic() - began:6.0f} s  {words}", flush=True)

    answer = auvnn.improve(
        load(BELUGA / "beluga.yaml", actuation="wrench"),
        log,
        test=test,
        diagnosing="--no-diagnosis" not in sys.argv,
        tell=tell,
        **({"seconds": limit[0]} if limit else {}),
    )
    answer.write(out)
    whole = answer.to_dict()
    kept = ("waterfall", "baseline", "after", "loses", "left_out", "objective", "steps", "tried", "stopped")
    result = {k: whole[k] for k in kept}
    result |= {
        "seconds": whole["seconds"],
        "processor_seconds": time.process_time(),
        "warnings": whole["warnings"],
    }
    (out / "result.json").write_text(json.dumps(plain(result), indent=1), encoding="utf-8")
    for row in whole["waterfall"]:
        print(f"{row['step']:<28} {row['kind']:<28} {row['error']:.3f}")
    print(
        "plain regression",
        whole["baseline"]["total"],
        "persistence",
        whole["baseline"]["persistence"]["total"],
    )
    print("loses", whole["loses"], "processor seconds", round(time.process_time()))


if __name__ == "__main__":
    main()
