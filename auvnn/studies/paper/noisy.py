"""Case study II, drag under noise: figures 6 and 7, what freezing the weights shows, and the global estimate."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch

from auvnn.damping.bank import DampingBank
from auvnn.logs import Log, Run
from auvnn.models import GreyBox
from auvnn.models.structures import build_structure
from auvnn.studies.paper.answer import Study
from auvnn.studies.paper.curves import damping_curves_of, drag
from auvnn.studies.paper.following import (
    Array,
    Snapshot,
    adapted,
    frozen_ahead,
    learners,
    snapshot_of,
    tracked,
    window_rows,
)
from auvnn.studies.paper.noise_free import HELD_OUT_SEED
from auvnn.studies.paper.options import Options, number, word
from auvnn.studies.paper.plant import (
    by_axis,
    free_run,
    free_runs,
    load_plant,
    manoeuvre_log,
    over_range,
    rich_log,
    training_log,
    training_words,
)
from auvnn.training.fit_damping import Fit, fit_damping
from auvnn.training.fit_structure import OneStepData
from auvnn.training.problem import DampingProblem

# The noise of the run that is tracked is another draw than that of the training data.
LIVE_SEED = 50_000


def noise_of(described: Mapping[str, Any]) -> dict[str, Any]:
    """Return the paper's noise as a noise condition of `simulate`.

    Raises:
        ConfigError: a number is out of range, or the amplitude's meaning is unknown.
    """
    linear = number(described["linear_acceleration"], "case.noise.linear_acceleration")
    angular = number(described["angular_acceleration"], "case.noise.angular_acceleration")
    share = number(described["velocity"], "case.noise.velocity", high=1.0)
    return {
        "name": "case",
        "accelerations": True,
        "standard_deviation": {**dict.fromkeys(("du", "dv", "dw"), linear), **dict.fromkeys(("dp", "dq", "dr"), angular)},
        "relative": dict.fromkeys(("u", "v", "w", "p", "q", "r"), share),
        "amplitude": word(described["amplitude"], "case.noise.amplitude", ("std", "uniform")),
    }  # fmt: skip


def noisy(options: Options, progress: Callable[[str], None]) -> Study:
    """Train the six networks on noisy accelerations without prefilter, run free, then go on learning online."""
    plant, case = load_plant(options.model), options.case
    noise = noise_of(case["noise"])
    truth = manoeuvre_log(plant, options).runs[0]
    training = training_log(plant, options, noise)
    live = manoeuvre_log(plant, options, noise, LIVE_SEED + options.seed).runs[0]
    model, fit = offline(plant, options, training)
    progress(f"offline: {fit.stopped_because}")
    spread = np.ptp(truth.nu, axis=0)
    ahead = number(case["ahead"], "case.ahead", 0.1)
    rows = window_rows(live, ahead, int(case["stride"]))
    still = snapshot_of(model)
    held = _held_out(plant, options)
    weights: dict[str, list[Snapshot] | Snapshot] = {"offline": still}
    tracks = {"offline": free_run(model, truth, options.step)}
    counts: dict[str, Any] = {}
    for name, described in learners(case).items():
        weights[name], adapter = adapted(model, live, described)
        tracks[name] = tracked(model, truth, weights[name], options.step)
        counts[f"{name}_updates"] = adapter.counts.adapted
        counts[f"{name}_reverted"] = adapter.counts.reverted
        counts[f"{name}_proven"] = adapter.counts.proven
        progress(f"online, {name}: {adapter.counts.adapted} of {adapter.counts.samples} samples learned from")
    metrics: dict[str, Any] = {"offline_training_s": fit.seconds, "offline_samples": training.samples}
    metrics["parameters"] = sum(p.numel() for p in still.values())
    table, windows = [], {}
    for name, own in weights.items():
        found = frozen_ahead(model, live, truth, own, rows, ahead, spread, options.step)
        windows[name] = found
        last = own if isinstance(own, Mapping) else own[-1]
        shape, runs = _global(model, last, plant, held, options)
        row = {
            "weights": name,
            "tracking_rmse_over_range_worst": float(over_range(tracks[name], truth.nu).max()),
            "frozen_rmse_over_range_worst": float(found.overall.max()),
            "frozen_windows_diverged": found.diverged,
            "held_out_damping_relative_error": shape,
            "held_out_rmse_over_range_worst": runs,
        }
        table.append(row)
        metrics |= by_axis(f"{name}_tracking_rmse_over_range", over_range(tracks[name], truth.nu))
        metrics |= by_axis(f"{name}_frozen_rmse_over_range", found.overall)
        metrics |= {f"{name}_{k}": v for k, v in row.items() if k.startswith(("held_out", "frozen_windows"))}
    base = metrics["offline_frozen_rmse_over_range_worst"]
    for name in learners(case):
        metrics[f"{name}_frozen_over_offline"] = metrics[f"{name}_frozen_rmse_over_range_worst"] / base
        ratio = (
            metrics[f"{name}_held_out_damping_relative_error"]
            / metrics["offline_held_out_damping_relative_error"]
        )
        metrics[f"{name}_global_error_over_offline"] = ratio
    metrics |= counts
    figures = _figures(plant, model, truth, tracks, windows, training, ahead)
    assumed = [*options.assumed(), training_words(options), *_assumed(case)]
    return Study(
        "noisy", plant.vehicle.name, options.to_dict(), assumed, metrics, table, figures,
        model, list(fit.warnings),
    )  # fmt: skip


def offline(plant: GreyBox, options: Options, log: Log) -> tuple[GreyBox, Fit]:
    """Return the six networks trained on equation 14 as it is, noise and all; random samples decide when to stop.

    The noise is white, so that samples drawn at random are an honest judge of the others.

    Args:
        plant: for the known equations.
        options: of the study.
        log: that is fitted.
    """
    how = options.case["offline"]
    known = build_structure("known", plant.vehicle, actuation="wrench")
    data = OneStepData.of(log, known)
    share = number(how.get("stopping", 0.0), "case.offline.stopping", 0.0, 0.9)
    drawn = np.random.default_rng([options.seed, 7]).random(len(data.nu)) < share
    scheme = dict(how.get("scheme") or options.scheme)
    if options.effort == "smoke":
        scheme |= {k: 40 for k in ("epochs", "max_iterations") if k in scheme}
    bank = DampingBank.from_description(dict(options.damping), options.seed)
    problem = DampingProblem(data.nu, data.damping_wrench(known), run=torch.tensor(drawn.astype(np.int64)))
    fit = fit_damping(bank, problem, scheme=scheme, held_out=[1] if drawn.any() else None, seed=options.seed)
    return GreyBox(known.vehicle, (), bank.requires_grad_(False), "wrench"), fit


def _held_out(plant: GreyBox, options: Options) -> list[Run]:
    return list(rich_log(plant, options, options.case["held_out"], seed=HELD_OUT_SEED + options.seed).runs)


def _global(
    model: GreyBox, weights: Snapshot, plant: GreyBox, held: list[Run], options: Options
) -> tuple[float, float]:
    """Return how wrong the damping is on held-out velocities, and how far the model runs free there.

    The first is the root mean square of d_hat(nu) - d(nu) over that of d(nu), worst degree of freedom.
    """
    import copy

    own = copy.deepcopy(model)
    assert own.damping is not None
    for name, parameter in own.damping.named_parameters():
        parameter.data.copy_(weights[name])
    nu = torch.tensor(np.concatenate([run.nu for run in held]))
    wrong, true = drag(own, nu) - drag(plant, nu), drag(plant, nu)
    shape = (wrong.square().mean(0) / true.square().mean(0)).sqrt()
    named = {str(i): run for i, run in enumerate(held)}
    moved = free_runs(own, named, options.step)
    runs = [over_range(moved[name], run.nu).max() for name, run in named.items()]
    return float(shape.max()), float(np.mean(runs))


def _figures(
    plant: GreyBox, model: GreyBox, truth: Run, tracks: Mapping[str, Array], windows: Mapping[str, Any],
    training: Log, ahead: float,
) -> list[dict[str, Any]]:  # fmt: skip
    online = [name for name in tracks if name != "offline"]
    out = [
        {
            "name": "figure_6", "kind": "velocity", "t": truth.t,
            "lines": {"plant": truth.nu, "networks, trained on noisy data": tracks["offline"]},
            "title": "Figure 6: networks trained offline on noisy accelerations",
            "caption": "Free running; no prefilter. What noise leaves of the damping decides how far the model drifts.",
        }
    ]  # fmt: skip
    if online:
        out.append(
            {
                "name": "figure_7", "kind": "velocity", "t": truth.t,
                "lines": {"plant": truth.nu, **{f"online, {name}": tracks[name] for name in online}},
                "title": "Figure 7: the same networks with online learning",
                "caption": "As the paper draws it: the state is never corrected, but the weights follow every sample, so "
                "that the latest residual is fed through. It says little about the vehicle; the next figure does.",
            }
        )  # fmt: skip
    out += [
        {
            "name": "frozen", "kind": "ahead", "ahead": ahead, "unit": "share of the range",
            "windows": {name: (w.starts, w.rmse.max(axis=1)) for name, w in windows.items()},
            "title": f"Weights frozen at each moment, {ahead:g} s ahead",
            "caption": "Error of free runs that begin at the plant's state with the weights of that moment, worst "
            "degree of freedom, over the range of the plant's velocity.",
        },
        {
            "name": "damping", "kind": "damping", "curves": damping_curves_of(model, plant, training),
            "title": "What damping was learned offline",
            "caption": "Force and moment against each velocity alone. Shaded: velocities that the training data covered, "
            "one at a time; the manoeuvre is one curve through them, and off that curve nothing was measured.",
        },
    ]  # fmt: skip
    return out


def _assumed(case: Mapping[str, Any]) -> list[str]:
    noise, how = case["noise"], case["offline"]
    meaning = (
        "standard deviation of normal noise" if noise["amplitude"] == "std" else "half-width of uniform noise"
    )
    return [
        f'ours: the noise\'s "amplitude" is the {meaning}',
        f"ours: {100 * float(how['stopping']):g} % of the training samples, drawn at random, decide when training stops",
        "ours: attitude is measured without noise; the paper adds noise to velocities and accelerations alone",
        *(
            f"ours: online learning '{n}': {', '.join(f'{k} {v}' for k, v in d.items())}"
            for n, d in learners(case).items()
        ),
    ]
