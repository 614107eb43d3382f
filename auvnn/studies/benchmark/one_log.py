"""One log of the benchmark: hide, drive, diagnose, and say what came out as plain data."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from auvnn.answers import plain
from auvnn.effects import EFFECTS
from auvnn.errors import AuvnnError, one_line
from auvnn.studies.benchmark.cases import Case
from auvnn.studies.benchmark.counts.counting import TIED, wrapped
from auvnn.studies.benchmark.strangers import axis_of, said_axis, sized_stranger

# The plant's step, s: the error of 2e-5 m/s that the longer one leaves is far below any noise, but not below none.
STEP_WITHOUT_NOISE, STEP_WITH_NOISE = 0.01, 0.025
# At least so many samples per second where an effect of a stated cost is sized.
SIZING_RATE = 20.0


def run_case(case: Case) -> dict[str, Any]:
    """Hide, diagnose, and return what came out, as plain data; a fault is an outcome, not an end."""
    import torch

    torch.set_num_threads(1)
    # Until there is a log, nothing that goes wrong is the diagnosis' doing.
    row, began = {**case.to_row(), "made": False}, time.monotonic()
    try:
        row.update(_answered(case, row))
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
    return {
        "excitation": case.excitation,
        "noise": noise_of(case),
        "seed": case.seed,
        "runs": case.runs,
        "duration": case.duration,
        "rate": case.rate,
    }


def noise_of(case: Case) -> str | dict[str, Any]:
    """Return the noise condition, with noise for accelerations that it says nothing of but that are logged."""
    from auvnn.studies.hidden import ACCELERATION_NOISE

    if case.accelerations and case.noise == "realistic":
        return {"name": case.noise, "standard_deviation": ACCELERATION_NOISE}
    return case.noise


def _answered(case: Case, begun: dict[str, Any]) -> dict[str, Any]:
    """Return what is answered; note in `begun` once there is a log to answer for."""
    from auvnn.diagnosis import diagnose
    from auvnn.logs.without_sensors import without
    from auvnn.metrics.unmeasured import completed
    from auvnn.models import load
    from auvnn.simulation import simulate
    from auvnn.studies.benchmark.falls import fall, names_to_add

    model, began = load(case.vehicle), time.monotonic()
    hidden = _hidden(case, model)
    step = STEP_WITHOUT_NOISE if case.noise == "none" else STEP_WITH_NOISE
    # Only an independent plant is named: a package without any has its own equations alone.
    more: dict[str, Any] = {} if case.plant == "own" else {"plant": case.plant}
    if case.world:
        more["world"] = case.world
    if case.accelerations is not None:
        more["accelerations"] = case.accelerations
    # Further runs of the same plant follow those that are diagnosed; they do not change them.
    whole = {**conditions(case), **more, "runs": case.runs + case.held_out}
    made = simulate(model, hidden=hidden, coefficients=case.coefficients, max_step=step, **whole)
    begun["world_law"] = made.truth.get("world")
    numbers = [run.number for run in made.log.runs]
    log = made.log.select(numbers[: case.runs]) if case.held_out else made.log
    log = completed(model, without(log, case.without))
    simulated = time.monotonic()
    begun["made"] = True
    candidates = None if case.candidates is None else list(case.candidates)
    # In the model's own world rates are those of evidence alone. A world that departs from every assumption leaves a
    # force in each log: there, as for users, what does not matter does not count.
    tolerance = None if case.world else 0.0
    # What names cost decides in which order, and which of several, are told; with no tolerance it decides nothing.
    found = diagnose(
        model, log, candidates, advice=False, whiteness=False, tolerance=tolerance, costs=bool(case.world)
    )
    diagnosed = time.monotonic()
    row: dict[str, Any] = {
        "verdict": found.verdict,
        "missing": found.missing,
        "p_value": found.global_p_value,
        "unexplained": found.unexplained,
        "nearest": found.nearest,
        "left": getattr(found, "left", None),
        "steps": [s["verdict"] for s in found.steps],
        "found": [{"verdict": s["verdict"], "effects": list(s["effects"])} for s in found.steps],
        "truth": hidden,
        "ranking": [c["effect"] for c in found.candidates[:3]],
        "parameters": {},
    }
    of = {c["effect"]: c["parameters"] for c in found.candidates}
    if case.kind == "effect":
        row["parameters"] = of.get(case.hidden, {})
    elif case.kind == "several":
        row["parameters"] = {name: of.get(name, {}) for name in case.effects}
    elif case.kind == "nothing":
        row["p_values"] = {c["effect"]: c["p_value"] for c in found.candidates if c["p_value"] is not None}
    else:
        row.update(
            axis=next(iter(found.acts_in), None) or said_axis(found.depends_on),
            axes_true=axis_of(case.hidden),
            depends_on=found.depends_on,
            acts_in=found.acts_in,
        )
        if case.oracle:
            row.update(_seen(case, model, log, made, found))
    of_the_catalogue = case.kind in ("effect", "several")
    if of_the_catalogue:
        row["errors"] = errors_of(case, hidden, row["parameters"])
        if case.held_out:
            held = completed(model, without(made.log.select(numbers[case.runs :]), case.without))
            row["fall"] = fall(model, made.plant, log, held, names_to_add(found.steps))
        if case.ties:
            row.update(_ties(case, model, log, made.truth, found))
        if case.oracle:
            row.update(_seen(case, model, log, made, found))
    else:
        row["errors"] = {}
    return {
        **row,
        "seconds_simulate": simulated - began,
        "seconds_diagnose": diagnosed - simulated,
        "seconds_judge": time.monotonic() - diagnosed,
    }


def _hidden(case: Case, model: Any) -> dict[str, dict[str, float]]:
    """Return what is hidden, each of its size."""
    from auvnn.simulation import make_noise
    from auvnn.studies.hidden import sized

    if case.kind == "stranger":
        how = {k: v for k, v in conditions(case).items() if k != "noise"}
        return {case.hidden: sized_stranger(model, case.hidden, case.size, **how)}
    logged = make_noise(case.noise).accelerations if case.accelerations is None else case.accelerations
    return {
        name: _costly(case, model, name, size)
        if size.endswith("%")
        else sized(model, name, size, **conditions(case), accelerations=logged, without=case.without)
        for name, size in zip(case.effects, case.sizes, strict=True)
    }


def _costly(case: Case, model: Any, name: str, size: str) -> dict[str, float]:
    """Return an effect of a stated cost, found at a moderate rate: commands between samples would only take time."""
    from auvnn.studies.benchmark.costs import costly

    world = {"name": case.world, "control_rate": 0.0} if case.world else None
    how = {**conditions(case), "rate": max(case.rate, SIZING_RATE), "coefficients": case.coefficients}
    return costly(model, name, 0.01 * float(size[:-1]), plant=case.plant, world=world, **how)


def _seen(case: Case, model: Any, log: Any, made: Any, found: Any) -> dict[str, Any]:
    """Return what the hidden effect costs, and what an oracle sees of it that knows the world's law.

    What a stranger costs is not asked: no model can hold it. Rivals are the names of the first step that are not hidden,
    and the three that lead the table.
    """
    from auvnn.studies.benchmark.costs import cost_of
    from auvnn.studies.benchmark.identifiability.oracle import Oracle

    hidden = (
        {case.hidden: {}} if case.kind == "stranger" else {n: made.truth["hidden"][n] for n in case.effects}
    )
    first = next((list(s["effects"]) for s in found.steps if s["effects"]), [])
    rivals = dict.fromkeys([*first, *[c["effect"] for c in found.candidates[:3]]])
    known = [n for n in rivals if n not in hidden and n in EFFECTS]
    oracle = Oracle(model, made, case.runs, list(hidden))
    distances = oracle.distances(known)
    if case.kind == "stranger":
        return {"oracle_distances": distances}
    return {"cost": cost_of(model, log, hidden), "oracle_distances": distances}


def _ties(case: Case, model: Any, log: Any, truth: Mapping[str, Any], found: Any) -> dict[str, Any]:
    """Return which effects can pass for the hidden ones on this log, by distance in standard errors.

    Of every candidate by the package's own equations; of a group that was declared, holds a hidden effect
    and one that can pass for it, also by differences of the plant, where another plant made the log and windows say it.
    """
    from auvnn.studies.benchmark.identifiability.information import Truth, imitation, information, truth_point
    from auvnn.studies.benchmark.identifiability.plant_information import covers, plant_information

    hidden = {name: truth["hidden"][name] for name in case.effects}
    rivals = [c["effect"] for c in found.candidates if c["p_value"] is not None]
    rivals = [n for n in rivals if n not in hidden]
    point = truth_point(model, log, Truth(hidden, truth["coefficients"]), rivals, noise_of(case))
    own = imitation(information(point), rivals)
    out: dict[str, Any] = {"imitation": own}
    group = [s["effects"] for s in found.steps if s["verdict"] == "ambiguous" and {*s["effects"]} & {*hidden}]
    # A tie takes the plant's word as well; where the equations find none, there is nothing to confirm.
    close = group and any(own[h].get(n, np.inf) <= TIED for h in own for n in group[0])
    if case.plant != "own" and close:
        names = list(dict.fromkeys([*hidden, *group[0]]))
        if covers(case.plant, names):
            bottom = truth["conditions"]["bottom"]
            by_plant = plant_information(case.plant, model, point, names, bottom)
            out["plant_imitation"] = imitation(by_plant, [n for n in group[0] if n not in hidden])
    return out


def errors_of(
    case: Case, truth: Mapping[str, Mapping[str, float]], parameters: Mapping[str, Any]
) -> dict[str, dict[str, float | None]]:
    """Return each parameter's error, relative to its effect's size, and in standard errors.

    Of several effects, a parameter is called by its effect and its own name. A shape, an onset or a frequency, has
    no distance from its null and so no relative error.

    Args:
        case: of the benchmark.
        truth: what was hidden, name to parameters.
        parameters: as the diagnosis answered them.
    """
    out: dict[str, dict[str, float | None]] = {}
    for effect, hidden in truth.items():
        kind = EFFECTS.get(effect)
        described, values = kind.describe(*_described(case.vehicle)), kind.told(dict(hidden))
        null = {p.name: p.null for p in described if not p.shape}
        size = max(np.sqrt(sum((values[n] - v) ** 2 for n, v in null.items())), 1e-300)
        answered = parameters if case.kind == "effect" else parameters.get(effect, {})
        for name, value in values.items():
            found = answered.get(name)
            if found is None or found["value"] is None:
                continue
            gap, std = wrapped(found["value"] - value, found.get("unit")), found["std"]
            out[name if case.kind == "effect" else f"{effect}.{name}"] = {
                "relative": abs(gap) / size if name in null else None,
                "z": gap / std if std and np.isfinite(std) else None,
            }
    return out


def _described(vehicle: str) -> tuple[Any, str]:
    from auvnn.vehicle import load_vehicle

    known = load_vehicle(vehicle)
    return known, "thrusters" if known.thrusters else "wrench"
