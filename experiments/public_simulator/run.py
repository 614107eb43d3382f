"""Changes hidden in a public simulator's REMUS 100: is each one named, by a model of that vehicle fitted to clean logs?

python experiments/public_simulator/run.py CHECKOUT OUT [seed=50] [NAME ...]

Of the K-th change the log has the seed K more than that which is given: another one is another log, with other headings,
depths, revolutions and noise.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from remus import Plant, description, disagreement, simulator

import auvnn

# Of the log with nothing hidden; the next change's is one more.
SEED = 50
# Fitted to the clean log: what the class has no number for in the package's terms.
FITTED = ("linear_damping", "quadratic_damping", "coupled_damping")


def _set(**values: Any) -> Callable[[Any], None]:
    def change(vehicle: Any) -> None:
        for name, value in values.items():
            # A number that the class does not have would hide nothing.
            if not hasattr(vehicle, name):
                raise SystemExit(f"the simulator's vehicle has no {name}")
            setattr(vehicle, name, value)

    return change


def _buoyant(vehicle: Any) -> None:
    vehicle.B = vehicle.W + 3.0


def _more_added_mass(vehicle: Any) -> None:
    # Its damping goes by the whole mass, and stays as it is.
    vehicle.MA = 1.5 * vehicle.MA
    vehicle.Minv = np.linalg.inv(vehicle.MRB + vehicle.MA)


def _more_drag(vehicle: Any) -> None:
    vehicle.CD_0 *= 1.5


def _off_centre(vehicle: Any) -> None:
    vehicle.r_bg = vehicle.r_bg + np.array([0.0, 0.003, 0.0])


def _weak_fins(vehicle: Any) -> None:
    vehicle.CL_delta_r, vehicle.CL_delta_s = 0.75 * vehicle.CL_delta_r, 0.75 * vehicle.CL_delta_s


def _load(vehicle: Any) -> None:
    # Half a kilogram at the bow.
    mass, place = 0.5, np.array([0.5, 0.0, 0.05])
    cross = np.array([[0, -place[2], place[1]], [place[2], 0, -place[0]], [-place[1], place[0], 0]])
    moved = np.eye(6)
    moved[:3, 3:] = cross.T
    weight = vehicle.MRB[0, 0]
    vehicle.MRB = vehicle.MRB + moved.T @ np.diag([mass] * 3 + [0] * 3) @ moved
    vehicle.Minv = np.linalg.inv(vehicle.MRB + vehicle.MA)
    vehicle.r_bg = (weight * vehicle.r_bg + mass * place) / (weight + mass)
    vehicle.W += 9.81 * mass


# What is hidden by the name that it has in the catalogue: what changes of the vehicle, its commands or its sensors.
CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "ocean_current": {"change": _set(V_c=0.3, beta_c=1.0)},
    "thruster_gain": {"command": lambda given: given * [1.0, 1.0, 0.8**0.5]},
    "net_buoyancy": {"change": _buoyant},
    "added_mass": {"change": _more_added_mass},
    "cg_offset": {"change": _off_centre},
    "quadratic_damping": {"change": _more_drag},
    "fin_gain": {"change": _weak_fins},
    "fin_offset": {"command": lambda given: given + np.array([0.05, 0.0, 0.0])},
    "fin_lag": {"change": _set(T_delta=0.4)},
    "propeller_lag": {"change": _set(T_n=0.6)},
    "payload": {"later": _load},
    "gyro_bias": {"sensors": lambda nu: nu + np.array([0, 0, 0, 0, 0, 0.01])},
    "velocity_scale": {"sensors": lambda nu: nu * [1.03, 1.03, 1.03, 1, 1, 1]},
}


def fitted(module: Any, out: Path) -> Path:
    """Return the model of the vehicle as its user would have it: fitted to a log in which nothing is hidden."""
    folder = out / "model"
    if not folder.exists():
        vehicle = Plant(module).vehicle()
        given = description(vehicle)
        (out / "given.yaml").write_text(yaml.safe_dump(given, sort_keys=False))
        plain = auvnn.load(str(out / "given.yaml")).without_absent()
        effects = [e for e in plain.copied_effects() if e.name not in ("propeller_lag", "fin_lag")]
        shares = zip("XYZKMN", disagreement(vehicle, plain.rebuilt(effects)), strict=True)
        print(
            "forces of the model, off by: " + ", ".join(f"{k} {100 * x:.0f} %" for k, x in shares), flush=True
        )
        log = auvnn.Log.read(Plant(module).write(out / "clean.parquet", 1))
        better = auvnn.add(str(out / "given.yaml"), log, list(FITTED))
        steps = ", ".join(f"{s['step']} {s['error']:.3f}" for s in better.waterfall if s["error"] is not None)
        print(f"model: error of 5 s on the run that was held out: {steps}", flush=True)
        better.model.save(folder)
    return folder


def main(checkout: str, out: Path, wanted: list[str], seed: int = SEED) -> None:
    """Hide each change in turn and print what is said of it."""
    unknown = sorted({*wanted} - {*CHANGES})
    if unknown:
        raise SystemExit(f"{', '.join(unknown)}: no such change; there are {', '.join(CHANGES)}")
    module = simulator(Path(checkout))
    out.mkdir(parents=True, exist_ok=True)
    model = fitted(module, out)
    for k, (name, plant) in enumerate(CHANGES.items()):
        if wanted and name not in wanted:
            continue
        log = Plant(module, **plant).write(out / f"{name}.parquet", seed + k)
        began = time.monotonic()
        found = auvnn.diagnose(str(model), log)
        groups = [s["effects"] for s in found.steps if s["effects"]]
        row = {
            "hidden": name,
            "verdict": found.verdict,
            "groups": groups,
            "first": bool(groups) and name in groups[0],
            "seconds": round(time.monotonic() - began, 1),
        }
        said = ", then ".join(" or ".join(g) for g in groups) or found.verdict
        print(f"{name:<18} {said} ({found.verdict}, {row['seconds']:.0f} s)", flush=True)
        done = out / "answers.json"
        known = json.loads(done.read_text()) if done.exists() else []
        kept = [r for r in known if r["hidden"] != name] + [row]
        done.write_text(json.dumps(kept, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    seeds = [int(w.removeprefix("seed=")) for w in sys.argv[3:] if w.startswith("seed=")]
    main(sys.argv[1], Path(sys.argv[2]), [w for w in sys.argv[3:] if "=" not in w], *(seeds[-1:] or [SEED]))
