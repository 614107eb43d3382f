"""Case study I, drag from noise-free signals: figure 5, and whether it shows that the damping was identified."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from auvnn.catalogue import unknown_name
from auvnn.damping.bank import DampingBank
from auvnn.errors import ConfigError
from auvnn.logs import Log, Run
from auvnn.models import GreyBox
from auvnn.models.structures import STRUCTURES, build_structure
from auvnn.models.structures.base import parameter_count
from auvnn.studies.paper.answer import Study
from auvnn.studies.paper.curves import damping_curves_of
from auvnn.studies.paper.options import Options
from auvnn.studies.paper.plant import (
    by_axis,
    free_runs,
    load_plant,
    manoeuvre_log,
    over_range,
    rich_log,
    runs_of,
)
from auvnn.training.fit_structure import StructureFit, fit_structure

Array = np.ndarray
# Seeds of what is held out, far from those of what is fitted.
HELD_OUT_SEED = 100_000
HELD_OUT = ("multisine", "manoeuvre")
# Structures under another name: with options that make them something else.
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "one_network": ("damping", {"networks": "one"}),
    "separate_all": ("separate", {"inertia": "learned", "damping": "learned", "restoring": "learned"}),
    "classical_coupled": ("classical", {"coupled": True}),
}


def noise_free(options: Options, progress: Callable[[str], None]) -> Study:
    """Train the six networks on the paper's manoeuvre without noise, run free, and hold other manoeuvres against it.

    Beyond the paper: the same networks trained on a rich manoeuvre, a larger network, the spread of restarts, and the
    other structures on the same data.
    """
    plant = load_plant(options.model)
    case = options.case
    log = manoeuvre_log(plant, options)
    run = log.runs[0]
    known = build_structure("known", plant.vehicle, actuation="wrench")
    model, fit = six_networks(plant, options, log)
    progress(f"six networks on the paper's manoeuvre: {fit.stopped}")
    held = _held_out(plant, options, run)
    moved = {name: free_runs(m, held, options.step) for name, m in (("manoeuvre", model), ("known", known))}
    drawn, zero = moved["manoeuvre"]["manoeuvre"], moved["known"]["manoeuvre"]
    metrics: dict[str, Any] = {
        **by_axis("manoeuvre_rmse_over_range", over_range(drawn, run.nu)),
        **by_axis("manoeuvre_zero_damping_rmse_over_range", over_range(zero, run.nu)),
        "manoeuvre_fit_relative_rmse_worst": max(fit.details["relative_rmse_of_wrench"]),
        "parameters": fit.parameters,
        "samples": fit.samples,
        "training_s": fit.seconds,
    }
    figures = [
        {
            "name": "figure_5", "kind": "velocity", "t": run.t,
            "lines": {"plant": run.nu, "networks": drawn, "zero damping": zero},
            "title": "Figure 5: free running of the model with networks for the damping",
            "caption": "Velocity of the plant and of the model with the six networks trained on this manoeuvre; they lie "
            "on top of each other, as in the paper. The model without damping is drawn where it stays near them; where "
            "it does not, a line under the figure says how far off it is.",
        }
    ]  # fmt: skip
    rich = rich_log(plant, options, case["rich"], seed=options.seed)
    table: list[dict[str, Any]] = []
    wide, wide_fit = six_networks(plant, options, rich, _hunt(case["rich"].get("hunt")))
    progress(f"six networks on the rich manoeuvre: {wide_fit.stopped}")
    moved["rich"] = free_runs(wide, held, options.step)
    for name in ("manoeuvre", "rich"):
        for where, error in _errors(moved[name], held).items():
            metrics |= by_axis(f"{name}_trained_held_out_{where}_rmse_over_range", error)
    metrics["held_out_rmse_over_range_worst"] = max(
        metrics[f"rich_trained_held_out_{where}_rmse_over_range_worst"] for where in held
    )
    metrics["rich_relative_residual"] = _residual(wide_fit)
    metrics["rich_training_s"] = wide_fit.seconds
    if case.get("larger"):
        size = int(case["larger"])
        large, large_fit = six_networks(plant, options, rich, _hunt(case.get("larger_hunt")), hidden=size)
        metrics["larger_hidden_units"] = int(case["larger"])
        metrics["larger_parameters"] = large_fit.parameters
        metrics["larger_relative_residual"] = _residual(large_fit)
        for where, error in _errors(free_runs(large, held, options.step), held).items():
            metrics[f"larger_held_out_{where}_rmse_over_range_worst"] = float(error.max())
        metrics["larger_held_out_rmse_over_range_worst"] = max(
            metrics[f"larger_held_out_{where}_rmse_over_range_worst"] for where in held
        )
        progress(f"{case['larger']} hidden units: {large_fit.stopped}")
    if case.get("best_of"):
        metrics |= _best_of(
            plant, options, rich, int(case["best_of"]), metrics["rich_relative_residual"], progress
        )
    for data, words in ((rich, "rich"), (log, "manoeuvre")):
        ours = {"damping": (wide, wide_fit) if words == "rich" else (model, fit)}
        done = {"damping": moved[words], "known": moved["known"]}
        table += _compare(plant, options, data, words, held, ours, done, progress)
    metrics |= _ratios(table)
    first = held["multisine"]
    figures += [
        {
            "name": "held_out", "kind": "velocity", "t": first.t,
            "lines": {
                "plant": first.nu, "trained on rich data": moved["rich"]["multisine"],
                "trained on the paper's manoeuvre": moved["manoeuvre"]["multisine"],
            },
            "title": "A manoeuvre that nothing was trained on",
            "caption": "Agreement on the training manoeuvre does not show that the damping was identified: the paper's "
            "manoeuvre is one curve in six-dimensional velocity space. Trained on a rich manoeuvre, the same networks "
            "hold elsewhere.",
        },
        {
            "name": "damping", "kind": "damping", "curves": damping_curves_of(wide, plant, rich),
            "title": "What damping was learned",
            "caption": "Force and moment against each velocity alone, networks trained on the rich manoeuvre, and the "
            "plant's own. Shaded: velocities that the training data covered.",
        },
        {
            "name": "structures", "kind": "structures", "rows": table,
            "title": "The paper's structures on the same data",
            "caption": "Free-running error in the worst degree of freedom on manoeuvres held out, by structure, trained "
            "without noise on the rich manoeuvre and on the paper's.",
        },
    ]  # fmt: skip
    return Study(
        "noise_free", plant.vehicle.name, options.to_dict(), [*options.assumed(), *_assumed(case)], metrics, table,
        figures, model, list(fit.details.get("warnings", [])),
    )  # fmt: skip


def six_networks(
    plant: GreyBox,
    options: Options,
    log: Log,
    hunt: Mapping[str, Any] | None = None,
    hidden: int | None = None,
    **how: Any,
) -> tuple[GreyBox, StructureFit]:
    """Return the six networks of `options.damping` in the known model, trained on a log, and how that went.

    Args:
        plant: gives the known part.
        options: the form of the networks and the scheme.
        log: what they are trained on.
        hunt: options of Levenberg-Marquardt that replace the scheme's, where local minima matter.
        hidden: units in the place of those of `options.damping`.
        **how: to `fit_structure`.
    """
    known = build_structure("known", plant.vehicle, actuation="wrench")
    form = dict(options.damping) if hidden is None else {**options.damping, "hidden": hidden}
    bank = DampingBank.from_description(form, options.seed)
    model = GreyBox(known.vehicle, (), bank, "wrench")
    scheme = dict(options.scheme)
    if scheme.get("scheme") == "levenberg_marquardt":
        scheme |= dict(hunt or {})
    fit = fit_structure(model, log, scheme=scheme, seed=options.seed, **how)
    return model.requires_grad_(False), fit


def _held_out(plant: GreyBox, options: Options, run: Run) -> dict[str, Run]:
    """Return manoeuvres that nothing is trained on; the paper's own is one for networks trained on rich data.

    The multisine has the manoeuvre's times, so that models run free on both side by side.
    """
    rich = {**options.case["rich"], "runs": 1, "duration": options.duration, "rate": options.rate}
    fresh = rich_log(plant, options, rich, seed=HELD_OUT_SEED + options.seed)
    return dict(zip(HELD_OUT, (fresh.runs[0], run), strict=True))


def _hunt(described: Mapping[str, Any] | None) -> dict[str, int]:
    """Return options of the search for a good optimum as whole numbers."""
    return {str(k): int(v) for k, v in (described or {}).items()}


def _errors(moved: Mapping[str, Array], held: Mapping[str, Run]) -> dict[str, Array]:
    return {name: over_range(moved[name], run.nu) for name, run in held.items()}


def _residual(fit: StructureFit) -> float:
    """Return the root mean square over the degrees of freedom of the relative one-step residual."""
    return float(np.sqrt(np.mean(np.square(fit.details["relative_rmse_of_wrench"]))))


def _best_of(
    plant: GreyBox, options: Options, rich: Log, count: int, own: float, progress: Callable[[str], None]
) -> dict[str, float]:
    """Train from many starting points, none of them dropped, and compare the best residual with our own."""
    scheme = {**options.scheme, "restarts": count, "halve_every": 10**6}
    bank = DampingBank.from_description(dict(options.damping), options.seed)
    model = GreyBox(build_structure("known", plant.vehicle, actuation="wrench").vehicle, (), bank, "wrench")
    fit = fit_structure(model, rich, scheme=scheme, seed=options.seed)
    progress(f"best of {count} restarts: {fit.seconds:.0f} s")
    best = _residual(fit)
    return {
        f"best_of_{count}_relative_residual": best,
        f"residual_over_best_of_{count}": own / best,
        f"best_of_{count}_s": fit.seconds,
    }


def _compare(
    plant: GreyBox, options: Options, data: Log, words: str, held: Mapping[str, Run],
    ours: Mapping[str, tuple[GreyBox, StructureFit]], done: Mapping[str, Mapping[str, Array]],
    progress: Callable[[str], None],
) -> list[dict[str, Any]]:  # fmt: skip
    """Return one row for each structure: what it learns, and how far it runs free on manoeuvres held out.

    `ours` are structures that are trained already, `done` those that have run free already.
    """
    rows = []
    for name in options.case["structures"]:
        structure, given = VARIANTS.get(name, (name, {}))
        if structure not in STRUCTURES:
            raise ConfigError(
                f"case.structures: {unknown_name('structure', str(name), [*STRUCTURES.names(), *VARIANTS])}"
            )
        if name in ours:
            model, fit = ours[name]
        else:
            model = build_structure(structure, plant.vehicle, actuation="wrench", seed=options.seed, **given)
            limits = {k: int(options.case["joint"][k]) for k in ("restarts", "iterations")}
            fit = fit_structure(
                model, data, seed=options.seed, restarts=limits["restarts"], max_iterations=limits["iterations"],
                progress=progress,
            )  # fmt: skip
        row = {
            "structure": name,
            "trained_on": words,
            "parameters": parameter_count(model),
            "one_step_relative_rmse": float(np.sqrt(np.mean(np.square(fit.relative_rmse)))),
            "training_s": fit.seconds,
        }
        moved = done.get(name) or free_runs(model, held, options.step)
        for where, error in _errors(moved, held).items():
            row[f"{where}_rmse_over_range_worst"] = float(error.max())
        rows.append(row)
    return rows


def _ratios(table: list[dict[str, Any]]) -> dict[str, float]:
    """Return how many times larger the parallel network's held-out error is than that of the six networks."""
    found = {(r["structure"], r["trained_on"]): r for r in table}
    out = {}
    for words in ("rich", "manoeuvre"):
        ours, other = found.get(("damping", words)), found.get(("parallel", words))
        if ours and other:
            out[f"parallel_over_six_one_step_{words}"] = (
                other["one_step_relative_rmse"] / ours["one_step_relative_rmse"]
            )
            for key in HELD_OUT:
                end = "" if key == "multisine" else f"_on_the_{key}"
                if (key, words) != ("manoeuvre", "manoeuvre"):
                    error = f"{key}_rmse_over_range_worst"
                    out[f"parallel_over_six_held_out_{words}{end}"] = other[error] / ours[error]
    return out


def _assumed(case: Mapping[str, Any]) -> list[str]:
    rich = case["rich"]
    return [
        f"ours: the rich manoeuvre is {runs_of(rich)} of {rich['duration']:g} s of random-phase multisines at "
        f"{rich['rate']:g} samples a second; the paper has no second manoeuvre",
        "ours: every structure of the comparison is trained on the same samples by Levenberg-Marquardt; joint problems "
        f"with {case['joint']['restarts']} starting points and {case['joint']['iterations']} iterations",
    ]


__all__ = ["noise_free", "six_networks"]
