"""Case study III, time-varying dynamics: a payload is picked up; figures 8 and 9."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from auvnn.errors import ConfigError
from auvnn.logs import Run
from auvnn.models import GreyBox, load
from auvnn.models.structures.base import without_damping
from auvnn.studies.paper.answer import Study
from auvnn.studies.paper.following import (
    Array,
    Change,
    adapted,
    frozen_ahead,
    learners,
    snapshot_of,
    tracked,
    window_rows,
)
from auvnn.studies.paper.noise_free import six_networks
from auvnn.studies.paper.options import Options, number, word
from auvnn.studies.paper.pick_up import Mission, _check_time, pick_up
from auvnn.studies.paper.plant import (
    by_axis,
    load_plant,
    over_range,
    training_log,
    training_words,
)

VARIANTS = ("paper", "physical")


def payload(options: Options, progress: Callable[[str], None]) -> Study:
    """Train on the empty vehicle, pick up the cylinder, and go on with and without online learning.

    M, C and g are known after the pick-up too, D is not: the networks were trained without the cylinder.
    """
    plant, case = load_plant(options.model), options.case
    variant = word(case["variant"], "case.variant", VARIANTS)
    _check_time(options)  # before minutes of training
    model, trained, warned = _offline(plant, options, progress)
    mission = pick_up(plant, options, variant)
    truth, live = mission.truth, mission.live
    known = GreyBox(without_damping(mission.loaded.vehicle), (), model.damping, "wrench")
    change = Change(mission.row, known)
    spread = np.ptp(truth.nu, axis=0)
    ahead, settle = number(case["ahead"], "case.ahead", 0.1), number(case["settle"], "case.settle")
    rows = window_rows(live, ahead, int(case["stride"]), float(truth.t[mission.row]))
    weights: dict[str, Any] = {"offline": snapshot_of(model)}
    counts: dict[str, Any] = {}
    for name, described in learners(case).items():
        weights[name], adapter = adapted(model, live, described, change)
        counts[f"{name}_updates"] = adapter.counts.adapted
        counts[f"{name}_reverted"] = adapter.counts.reverted
        counts[f"{name}_proven"] = adapter.counts.proven
        progress(f"online, {name}: {adapter.counts.adapted} of {adapter.counts.samples} samples learned from")
    metrics: dict[str, Any] = {
        **trained,
        "parameters": sum(p.numel() for p in weights["offline"].values()),
        "mass_ratio": float(mission.loaded.vehicle.mass / plant.vehicle.mass),
        "surge_speed_ratio_at_pick_up": 1.0 if mission.jump is None else float(mission.jump[0, 0]),
        **counts,
    }
    if mission.factors:
        metrics |= {"damping_factor_min": min(mission.factors), "damping_factor_max": max(mission.factors)}
    table, windows, tracks = [], {}, {}
    late = settle + float(truth.t[mission.row])
    for name, own in weights.items():
        tracks[name] = tracked(model, truth, own, options.step, change, mission.jump)
        found = frozen_ahead(known, live, truth, own, rows, ahead, spread, options.step)
        windows[name] = found
        counted = found.starts >= late - 1e-9
        if not counted.any():
            raise ConfigError(
                f"case.settle={settle:g} s leaves no window of {ahead:g} s: shorten one of them"
            )
        settled = np.sqrt(np.mean(found.rmse[counted] ** 2, axis=0))
        after = slice(mission.row, None)
        follow = np.sqrt(np.mean((tracks[name][after] - truth.nu[after]) ** 2, axis=0)) / spread
        metrics |= by_axis(f"{name}_tracking_rmse_over_range", follow)
        metrics |= by_axis(f"{name}_frozen_rmse_over_range", settled)
        table.append(
            {
                "weights": name,
                "tracking_rmse_over_range_worst": float(follow.max()),
                "frozen_rmse_over_range_worst": float(settled.max()),
                "frozen_windows_diverged": found.diverged,
            }
        )
    base = metrics["offline_frozen_rmse_over_range_worst"]
    for name in learners(case):
        metrics[f"{name}_frozen_over_offline"] = metrics[f"{name}_frozen_rmse_over_range_worst"] / base
    before = over_range(tracks["offline"][: mission.row], truth.nu[: mission.row])
    metrics["offline_before_pick_up_rmse_over_range_worst"] = float(before.max())
    given = case["offline"].get("model")
    how = training_words(options) if given is None else f"ours: the networks are those of {given}"
    assumed = [*options.assumed(), how, *_assumed(case, mission)]
    return Study(
        "payload", plant.vehicle.name, options.to_dict(), assumed,
        metrics, table,
        _figures(truth, tracks, windows, mission, ahead, late), model, warned,
    )  # fmt: skip


def _offline(
    plant: GreyBox, options: Options, progress: Callable[[str], None]
) -> tuple[GreyBox, dict[str, float], list[str]]:
    """Return the networks that know the empty vehicle, what their training cost, and its warnings.

    Raises:
        ConfigError: `case.offline.model` has no damping subnetworks.
    """
    given = options.case["offline"].get("model")
    if given is None:
        model, fit = six_networks(plant, options, training_log(plant, options, "none"))
        progress(f"six networks on the empty vehicle: {fit.stopped}")
        return model, {"training_s": fit.seconds}, list(fit.details.get("warnings", []))
    bank = load(str(given), actuation="wrench").damping
    if bank is None:
        raise ConfigError(
            f"case.offline.model={given}: has no damping subnetworks; give the model of a study"
        )
    model = GreyBox(without_damping(plant.vehicle), (), bank, "wrench").requires_grad_(False)
    return model, {}, []


def _figures(
    truth: Run,
    tracks: Mapping[str, Array],
    windows: Mapping[str, Any],
    mission: Mission,
    ahead: float,
    late: float,
) -> list[dict[str, Any]]:
    online = {f"online, {name}": track for name, track in tracks.items() if name != "offline"}
    marked = {"t": truth.t, "mark": float(truth.t[mission.row]), "mark_words": "pick-up"}
    out = []
    if online:
        out.append(
            {
                "name": "figure_8", "kind": "velocity", **marked, "lines": {"plant": truth.nu, **online},
                "title": "Figure 8: the damping changes, with online learning",
                "caption": "M and C change at the pick-up and are known, D changes and is not. The weights follow every "
                "sample, the state is never corrected.",
            }
        )  # fmt: skip
    out += [
        {
            "name": "figure_9", "kind": "velocity", **marked,
            "lines": {"plant": truth.nu, "networks, offline": tracks["offline"]},
            "title": "Figure 9: the same without online learning",
            "caption": "The networks still give the empty vehicle's damping.",
        },
        {
            "name": "frozen", "kind": "ahead", "ahead": ahead, "unit": "share of the range", "mark": late,
            "mark_words": "counted from here",
            "windows": {name: (w.starts, w.rmse.max(axis=1)) for name, w in windows.items()},
            "title": f"Weights frozen at each moment after the pick-up, {ahead:g} s ahead",
            "caption": "Error of free runs that begin at the plant's state with the weights of that moment, worst "
            "degree of freedom, over the range of the plant's velocity.",
        },
    ]  # fmt: skip
    return out


def _vector(values: Sequence[float]) -> str:
    return f"({', '.join(f'{v:g}' for v in values)})"


def _assumed(case: Mapping[str, Any], mission: Mission) -> list[str]:
    cylinder = case["cylinder"]
    added = mission.loaded.vehicle.mass
    out = [
        f"ours: the cylinder has a diameter of {cylinder['diameter']:g} m and is held with its centre at "
        f"{_vector(cylinder['position'])} m, its axis along {_vector(cylinder['axis'])}; the loaded vehicle has "
        f"{added:g} kg",
        "ours: M and C gain the cylinder's rigid-body inertia and its added mass by strip theory; g gains its weight "
        f"and buoyancy, which differ by {cylinder['net_weight']:g} N; all three are known to the model",
        "ours: the mission is the manoeuvre of case I with the pick-up on the way",
        f"ours: the noise of what is measured on the mission: {case['noise']}",
    ]
    if mission.factors:
        words = ", ".join(f"{f:.2f}" for f in mission.factors)
        out.append(
            f"ours: which coefficient gets which of the paper's factors 1.5 to 10 is drawn by the seed: {words}"
        )
        out.append(
            "as the paper: the velocity does not jump at the pick-up, which a rigid grasp would make it do"
        )
    else:
        out.append("ours: D gains the cylinder's own drag by component build-up, not factors")
        out.append("ours: momentum is kept at the grasp, nu+ = (M + M_p)^-1 M nu-, and the model knows it")
    return out
