"""One log of the benchmark: hide, drive, diagnose, and say what came out as plain data."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from auvnn.answers import plain
from auvnn.effects import EFFECTS
from auvnn.errors import AuvnnError, one_line
from auvnn.studies.benchmark.cases import NOTHING, Case

# The plant's step, s: the error of 2e-5 m/s that the longer one leaves is far below any noise, but not below none.
STEP_WITHOUT_NOISE, STEP_WITH_NOISE = 0.01, 0.025


def run_case(case: Case) -> dict[str, Any]:
    """Hide, diagnose, and return what came out, as plain data; a fault is an outcome, not an end."""
    import torch

    torch.set_num_threads(1)
    row, began = case.to_row(), time.monotonic()
    try:
        row.update(_answered(case))
        fault = None
    except AuvnnError as problem:
        fault = str(problem)
    except Exception as problem:
        # A fault of the program in one log of five hundred must not cost the others.
        fault = f"a fault of the program: {type(problem).__name__}: {one_line(problem, 300)}"
    if fault is not None:
        row.update(verdict="fault", missing=[])
    row.update(fault=fault, seconds=time.monotonic() - began)
    return plain(row)


def conditions(case: Case) -> dict[str, Any]:
    """Return what `simulate` is asked for, the hidden effects and the plant's step aside."""
    how: dict[str, Any] = {
        "excitation": case.excitation,
        "noise": noise_of(case),
        "seed": case.seed,
        "runs": case.runs,
        "duration": case.duration,
        "rate": case.rate,
    }
    return how


def noise_of(case: Case) -> str | dict[str, Any]:
    """Return the noise condition, with noise for accelerations that it says nothing of but that are logged."""
    from auvnn.studies.hidden import ACCELERATION_NOISE

    if case.accelerations and case.noise == "realistic":
        return {"name": case.noise, "standard_deviation": ACCELERATION_NOISE}
    return case.noise


def _answered(case: Case) -> dict[str, Any]:
    from auvnn.diagnosis import diagnose
    from auvnn.models import load
    from auvnn.simulate import make_noise, simulate
    from auvnn.studies.hidden import sized

    model, how, began = load(case.vehicle), conditions(case), time.monotonic()
    measured = {} if case.accelerations is None else {"accelerations": case.accelerations}
    logged = make_noise(case.noise).accelerations if case.accelerations is None else case.accelerations
    hidden = {
        name: sized(model, name, size, **how, accelerations=logged)
        for name, size in zip(case.effects, case.sizes, strict=True)
    }
    step = STEP_WITHOUT_NOISE if case.noise == "none" else STEP_WITH_NOISE
    # Only an independent plant is named: a package without any has its own equations alone.
    plant = {} if case.plant == "own" else {"plant": case.plant}
    # Further runs of the same plant follow those that are diagnosed; they do not change them.
    whole = {**how, **measured, **plant, "runs": case.runs + case.held_out}
    made = simulate(model, hidden=hidden, coefficients=case.coefficients, max_step=step, **whole)
    numbers = [run.number for run in made.log.runs]
    log = made.log.select(numbers[: case.runs]) if case.held_out else made.log
    simulated = time.monotonic()
    found = diagnose(model, log, None if case.candidates is None else list(case.candidates), advice=False)
    row: dict[str, Any] = {
        "verdict": found.verdict,
        "missing": found.missing,
        "p_value": found.global_p_value,
        "steps": [s["verdict"] for s in found.steps],
        "found": [{"verdict": s["verdict"], "effects": list(s["effects"])} for s in found.steps],
        "truth": hidden,
        "ranking": [c["effect"] for c in found.candidates[:3]],
        "parameters": {},
        "seconds_simulate": simulated - began,
        "seconds_diagnose": time.monotonic() - simulated,
    }
    of = {c["effect"]: c["parameters"] for c in found.candidates}
    if case.kind == "effect":
        row["parameters"] = of.get(case.hidden, {})
    elif case.kind == "several":
        row["parameters"] = {name: of.get(name, {}) for name in case.effects}
    elif case.hidden == NOTHING:
        row["p_values"] = {c["effect"]: c["p_value"] for c in found.candidates if c["p_value"] is not None}
    row["errors"] = errors_of(case, hidden, row["parameters"])
    return row


def errors_of(
    case: Case, truth: Mapping[str, Mapping[str, float]], parameters: Mapping[str, Any]
) -> dict[str, dict[str, float | None]]:
    """Return each parameter's error, relative to its effect's size, and in standard errors.

    Of several effects, a parameter is called by its effect and its own name. A shape, an onset or a frequency, has
    no distance from its null and so no relative error.
    """
    out: dict[str, dict[str, float | None]] = {}
    for effect, values in truth.items():
        described = EFFECTS.get(effect).describe(*_described(case.vehicle))
        null = {p.name: p.null for p in described if not p.shape}
        size = max(np.sqrt(sum((values[n] - v) ** 2 for n, v in null.items())), 1e-300)
        answered = parameters if case.kind == "effect" else parameters.get(effect, {})
        for name, value in values.items():
            found = answered.get(name)
            if found is None or found["value"] is None:
                continue
            gap, std = found["value"] - value, found["std"]
            out[name if case.kind == "effect" else f"{effect}.{name}"] = {
                "relative": abs(gap) / size if name in null else None,
                "z": gap / std if std and np.isfinite(std) else None,
            }
    return out


def _described(vehicle: str) -> tuple[Any, str]:
    from auvnn.vehicle import load_vehicle

    known = load_vehicle(vehicle)
    return known, "thrusters" if known.thrusters else "wrench"
