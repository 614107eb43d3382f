"""Damping, added mass and restoring uncertain at once: what each manoeuvre can tell of them together.

python experiments/several_uncertainties/run.py [OUT] [--model rov95] [--manoeuvres paper,multisine,survey]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import torch

from auvnn.answers import plain, write_text
from auvnn.studies.uncertainties import uncertainties


def main() -> None:
    """Run the study, print what it says, and write answer, figures and report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("out", nargs="?", default="outputs/several_uncertainties")
    parser.add_argument("--model", default="rov95")
    parser.add_argument("--manoeuvres", default="paper,multisine,survey")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    torch.set_num_threads(1)
    found = uncertainties(
        given.model,
        given.manoeuvres.split(","),
        seed=given.seed,
        progress=lambda words: print("   ", words, flush=True),
    )
    found.write(given.out)
    write_text(Path(given.out) / "summary.json", json.dumps(plain(found.metrics), indent=1))
    for line in found.story:
        print(line)
    for name, one in found.manoeuvres.items():
        for effect, share in one["swallowed"].items():
            if share["elsewhere"] is not None:
                print(
                    f"{name}: networks trained on {effect} give {share['elsewhere']:.2g} of it on the multisine"
                )
    print(f"report: {Path(given.out) / 'report.html'}")


if __name__ == "__main__":
    main()
