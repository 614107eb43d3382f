"""Changes hidden in a public simulator's vehicle: is each one named, by a model of that vehicle fitted to a clean log?

python experiments/public_simulator/run.py CHECKOUT OUT [seed=50] [NAME ...]

CHECKOUT is one of the PythonVehicleSimulator (REMUS 100), of bluerov2_dynamics (BlueROV2 Heavy) or of cola2_core (Girona
500). Of the K-th change the log has the seed K more than that which is given: another one is another log, with other
settings and noise.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bluerov2
import bluerov2_changes
import girona500
import girona500_changes
import remus
import remus_changes
import yaml
from logged import Changed

import auvnn
from auvnn.studies.benchmark.counts.counting import standing

# Of the log with nothing hidden; the next change's is one more.
SEED = 50


@dataclass(frozen=True)
class Study:
    """A vehicle of a simulator, and what is hidden in it.

    Attributes:
        simulator: the module of the vehicle from a checkout.
        plant: the vehicle, with what is changed of it.
        changes: what is hidden by its name.
        given: of a new vehicle, and of the answer's folder: the model that its user has.
        disagreement: of a new vehicle and a model: by how much its forces are off.
        fitted: to the clean log: what there is no number for.
        also: further names that are true of a change.
    """

    simulator: Callable[[Path], Any]
    plant: type[Changed]
    changes: Mapping[str, Mapping[str, Any]]
    given: Callable[[Any, Path], str]
    disagreement: Callable[[Any, Any], list[float]]
    fitted: tuple[str, ...]
    also: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


def _described(description: Callable[[Any], Mapping[str, Any]]) -> Callable[[Any, Path], str]:
    """Return what writes the model file of a vehicle from its numbers."""

    def given(vehicle: Any, out: Path) -> str:
        path = out / "given.yaml"
        path.write_text(yaml.safe_dump(dict(description(vehicle)), sort_keys=False))
        return str(path)

    return given


REMUS = Study(
    remus.simulator,
    remus.Plant,
    remus_changes.CHANGES,
    _described(remus.description),
    remus.disagreement,
    ("linear_damping", "quadratic_damping", "coupled_damping"),
)
# The built-in vehicle has the numbers of the same paper.
BLUEROV2 = Study(
    bluerov2.simulator,
    bluerov2.Plant,
    bluerov2_changes.CHANGES,
    lambda vehicle, out: "bluerov2_heavy",
    bluerov2.disagreement,
    ("thruster_lag",),
    bluerov2_changes.ALSO,
)
GIRONA500 = Study(
    girona500.simulator,
    girona500.Plant,
    girona500_changes.CHANGES,
    _described(girona500.description),
    girona500.disagreement,
    ("actuation_delay",),
    girona500_changes.ALSO,
)


def study_of(folder: Path) -> Study:
    """Return the study whose simulator a checkout is of."""
    others = ((bluerov2.FILE, BLUEROV2), (girona500.FILE, GIRONA500))
    return next((study for file, study in others if (folder / file).exists()), REMUS)


def fitted(study: Study, module: Any, out: Path) -> Path:
    """Return the model of the vehicle as its user would have it: fitted to a log in which nothing is hidden."""
    folder = out / "model"
    if not folder.exists():
        vehicle = study.plant(module).vehicle()
        given = study.given(vehicle, out)
        off = study.disagreement(vehicle, auvnn.load(given).without_absent())
        shares = ", ".join(f"{k} {100 * x:.1f} %" for k, x in zip("XYZKMN", off, strict=True))
        print(f"forces of the model, off by: {shares}", flush=True)
        log = auvnn.Log.read(study.plant(module).write(out / "clean.parquet", 1))
        better = auvnn.add(given, log, list(study.fitted))
        steps = ", ".join(f"{s['step']} {s['error']:.3f}" for s in better.waterfall if s["error"] is not None)
        print(f"model: error of 5 s on the run that was held out: {steps}", flush=True)
        better.model.save(folder)
    return folder


def main(checkout: str, out: Path, wanted: list[str], seed: int = SEED) -> None:
    """Hide each change in turn and print what is said of it."""
    study = study_of(Path(checkout))
    unknown = sorted({*wanted} - {*study.changes})
    if unknown:
        raise SystemExit(f"{', '.join(unknown)}: no such change; there are {', '.join(study.changes)}")
    module = study.simulator(Path(checkout))
    out.mkdir(parents=True, exist_ok=True)
    model = fitted(study, module, out)
    for k, (name, changed) in enumerate(study.changes.items()):
        if wanted and name not in wanted:
            continue
        log = auvnn.Log.read(study.plant(module, **changed).write(out / f"{name}.parquet", seed + k))
        error = auvnn.compare(str(model), log).to_dict()["rollout"]["5"]["total"]
        began = time.monotonic()
        found = auvnn.diagnose(str(model), log)
        # Without what a later step withdrew, which is no part of the answer.
        groups = [s["effects"] for s in standing({"found": found.steps}) if s["effects"]]
        true = (name, *study.also.get(name, ()))
        row = {
            "hidden": name,
            "verdict": found.verdict,
            "groups": groups,
            "first": bool(groups) and any(n in groups[0] for n in true),
            "error": round(error, 3),
            "seconds": round(time.monotonic() - began, 1),
        }
        said = ", then ".join(" or ".join(g) for g in groups) or found.verdict
        print(f"{name:<22} {said} ({found.verdict}, {row['seconds']:.0f} s; errs by {error:.3f})", flush=True)
        done = out / "answers.json"
        known = json.loads(done.read_text()) if done.exists() else []
        kept = [r for r in known if r["hidden"] != name] + [row]
        done.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    seeds = [int(w.removeprefix("seed=")) for w in sys.argv[3:] if w.startswith("seed=")]
    main(sys.argv[1], Path(sys.argv[2]), [w for w in sys.argv[3:] if "=" not in w], *(seeds[-1:] or [SEED]))
