"""What the record can say of a compressibility to somebody who knows all else, and what `diagnose` says where it can.

python experiments/glider/oracle.py DATA [OUT]             the record: estimates with their standard errors
python experiments/glider/oracle.py DATA OUT HIDDEN SEED   the record's dives made again with HIDDEN (1/m), and diagnosed
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from run import FILE, HERE, fitted, halves, plain
from torch import Tensor

from auvnn import diagnose
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.fit import fit_hypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, lay_out
from auvnn.diagnosis.noise_law.likelihood.estimate_law import estimate
from auvnn.diagnosis.noise_law.likelihood.sums import CELL, force_sums
from auvnn.diagnosis.score_tests.score import projection, score
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import predict
from auvnn.metrics.likely_states import likely_states
from auvnn.metrics.unmeasured import completed
from auvnn.metrics.windows import Windows, cut_windows
from auvnn.models import GreyBox, load

NAME = "compressibility"
# The authors' 5e-10 per Pa, by the metre of water: share of the buoyancy.
PUBLISHED = 5e-10 * 1005.3 * 9.80665
DEPTH_NOISE = 0.02  # m, of the made dives


def seen(
    at: Layout, windows: Windows, initial: Tensor, sigma: np.ndarray, base: list[str]
) -> dict[str, float]:
    """Return estimate, standard error and what the published value adds to the log-likelihood, at a fit."""
    model = at.model
    sums, _, _ = normal_equations(windows, linearise(model, windows, initial, model.effect_names), sigma)
    found = score(sums.finite(), at, base, NAME)
    part = projection(sums.total, sums.slope.sum(0), at, base, NAME)
    slope, curve = part.gradient[0] / found.inflation, part.information[0, 0] / found.inflation
    return {
        "estimate": slope / curve,
        "std": curve**-0.5,
        "inflation": found.inflation,
        "published_adds": slope * PUBLISHED - 0.5 * curve * PUBLISHED**2,
        "slope": slope,
        "curve": curve,
    }


def of_half(model: GreyBox, log: Log) -> dict[str, dict[str, float]]:
    """Return what one half says, all else known or as uncertain as stated, without and beside a stochastic force."""
    log = completed(model, log)
    layout, windows = lay_out(model, [NAME]), windows_for(model, log)
    base = [n for n in layout.names if n != NAME]
    first = fit_hypothesis(layout, windows, base, ())
    fit = first.fitted
    force = estimate(force_sums(first, windows, fit.sigma, CELL)).law
    copied = model.rebuilt(layout.model.copied_effects())
    set_parameters(copied, first.names, fit.theta)
    at = replace(layout, model=copied)
    out = {"windows": {"count": float(len(windows.first))}}
    for label, some in (
        ("white", windows),
        ("force", None if force is None else replace(windows, law=force)),
    ):
        if some is not None:
            out[f"{label}, all else known"] = seen(at, some, fit.initial, fit.sigma, [])
            out[f"{label}, as stated"] = seen(at, some, fit.initial, fit.sigma, base)
    return out


def record(data: Path, out: Path) -> dict[str, Any]:
    """Return the oracle's figures of both halves, and what the first half's estimate is worth on the second."""
    first, second = halves(data, out)
    model = load(HERE / "glider.yaml")
    a, b = of_half(model, first), of_half(model, second)
    left_out = {
        key: b[key]["slope"] * x["estimate"] - 0.5 * b[key]["curve"] * x["estimate"] ** 2
        for key, x in a.items()
        if key in b and "estimate" in x
    }
    return {"published": PUBLISHED, "first": a, "second": b, "first_half_estimate_adds_on_second": left_out}


def made(data: Path, out: Path, hidden: float, seed: int) -> dict[str, Any]:
    """Make the first half's dives again, pitch, ballast and density as recorded, and diagnose them."""
    first, _ = halves(data, out)
    model, _ = fitted(load(HERE / "glider.yaml"), first)
    there = model.with_effects({NAME: {"per_metre": hidden}}) if hidden else model
    rng, known = np.random.default_rng(seed), completed(model, first)
    runs = []
    for plain_run, run in zip(first.runs, known.runs, strict=True):
        runs.append(_made(there, model, known, run, plain_run, rng))
    log = replace(first, runs=tuple(runs))
    given = load(HERE / "glider.yaml")
    found = diagnose(given, log, whiteness=False, advice=False, costs=False, progress=print)
    table = {c["effect"]: c for c in found.candidates}
    return {
        "hidden": hidden,
        "seed": seed,
        "verdict": found.verdict,
        "missing": list(found.missing),
        "steps": found.steps,
        "parameters": table.get(NAME, {}).get("parameters"),
        "oracle": of_half(given, log)["white, as stated"],
    }


def _made(there: GreyBox, model: GreyBox, log: Log, run: Run, recorded: Run, rng: np.random.Generator) -> Run:
    windows = cut_windows(log.select(run.number), np.inf, warmup=0.0, kind="wrench")
    # From where the recorded dive began: whatever is hidden, the dives begin alike.
    eta, _ = predict(there, windows, likely_states(model, windows), engine="firm")
    first, count = int(windows.first[0]), int(windows.length[0])
    assert recorded.position is not None
    position = np.full(recorded.position.shape, np.nan)
    position[first : first + count, 2] = eta[0, :count, 2].detach().numpy()
    position[:, 2] += DEPTH_NOISE * rng.normal(size=len(position))
    return replace(recorded, position=position)


if __name__ == "__main__":
    if len(sys.argv) < 2 or not (Path(sys.argv[1]) / FILE).is_file():
        sys.exit(f"give the folder that holds {FILE}")
    folder = Path(sys.argv[2] if len(sys.argv) > 2 else "outputs/glider")
    folder.mkdir(parents=True, exist_ok=True)
    if len(sys.argv) > 4:
        answer = made(Path(sys.argv[1]), folder, float(sys.argv[3]), int(sys.argv[4]))
    else:
        answer = record(Path(sys.argv[1]), folder)
    print(json.dumps(plain(answer), indent=1))
