"""A real glider without rates and velocities: mass and drag from half of its dives, the depth rate of the other half.

python experiments/glider/run.py DATA [OUT]
"""

from __future__ import annotations

import csv
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from auvnn import diagnose
from auvnn.diagnosis.cross_validation.fitters import fitter_for
from auvnn.diagnosis.hypotheses.put_into_model import with_fitted_parameters
from auvnn.diagnosis.hypotheses.stated_priors import lay_out
from auvnn.logs import Log, Run
from auvnn.metrics.free_run import predict
from auvnn.metrics.likely_states import likely_states
from auvnn.metrics.unmeasured import completed
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox, load
from auvnn.physics.attitude import quat_to_matrix

HERE = Path(__file__).parent
FILE = "gliderflight_data.npy"
COLUMNS = ("unix_s", "pressure_bar", "pitch_rad", "drive_cm3", "density", "speed_adcp")
# Depths, m, between which the record can be used: near the surface it cannot, and the bottom is near below.
ABOVE, BELOW = 10.0, 35.0
KEPT = ("rate", "speed")


def raw_table(data: Path, path: Path) -> Path:
    """Write the record between the two depths as a table, each dive or climb with a number of its own."""
    columns = np.load(data / FILE, allow_pickle=False)
    depth = 10.0 * columns[1]
    inside = (depth > ABOVE) & (depth < BELOW)
    dive = np.cumsum(np.diff(inside.astype(int), prepend=0) > 0)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*COLUMNS, "dive"])
        for k in np.flatnonzero(inside):
            cells = ["" if np.isnan(x) else repr(float(x)) for x in columns[:, k]]
            writer.writerow([*cells, int(dive[k])])
    return path


def halves(data: Path, out: Path) -> tuple[Log, Log]:
    """Return the dives of the first half of the record and those of the second."""
    log = Log.read(raw_table(data, out / "raw.csv"), HERE / "mapping.yaml")
    middle = len(log.runs) // 2
    numbers = [run.number for run in log.runs]
    return log.select(numbers[:middle]), log.select(numbers[middle:])


def fitted(model: GreyBox, log: Log, names: tuple[str, ...] = ()) -> tuple[GreyBox, dict]:
    """Return the model with what is uncertain, and some effects, fitted to a log, and the fitted values."""
    log = completed(model, log)
    layout = lay_out(model, list(names))
    fitter = fitter_for(model, log)
    base = [n for n in layout.names if n not in names]
    found = fitter.fit(layout, base, (), None)
    for k in range(len(names)):
        found = fitter.fit(layout, base, names[: k + 1], found)
    std = np.sqrt(np.diag(found.fitted.covariance()))
    labels = [f"{n}.{p.name}" for n in found.names for p in layout.model.effect(n).parameters_of]
    values = {
        name: {"value": float(v), "std": float(s)}
        for name, v, s in zip(labels, found.fitted.theta, std, strict=True)
    }
    return with_fitted_parameters(model, layout, found), values


def depth_rate(run: Run) -> np.ndarray:
    """Return the measured depth rate (N,): central differences over four seconds."""
    z = run.position[:, 2]
    rate = np.full(run.samples, np.nan)
    rate[2:-2] = (z[4:] - z[:-4]) / (run.t[4:] - run.t[:-4])
    return rate


def predicted_rate(model: GreyBox, log: Log) -> list[tuple[Run, np.ndarray, np.ndarray]]:
    """Return by dive the run, its depth rate by free running from its first sample, (N,), and its speed, (N,)."""
    log = completed(model, log)
    out = []
    for run in log.runs:
        windows = cut_windows(log.select(run.number), np.inf, warmup=0.0, kind="wrench")
        eta, nu = predict(model, windows, likely_states(model, windows), engine="firm")
        world = (quat_to_matrix(eta[..., 3:]) @ nu[..., :3, None]).squeeze(-1)
        first, count = int(windows.first[0]), int(windows.length[0])
        rate, speed = np.full(run.samples, np.nan), np.full(run.samples, np.nan)
        rate[first : first + count] = world[0, :count, 2].detach().numpy()
        speed[first : first + count] = np.linalg.norm(nu[0, :count, :3].detach().numpy(), axis=1)
        out.append((run, rate, speed))
    return out


def scores(found: list[tuple[Run, np.ndarray, np.ndarray]]) -> dict[str, float]:
    """Return R2 and root mean square error of the depth rate and of the speed through the water, all dives together."""
    measured = np.concatenate([depth_rate(run) for run, _, _ in found])
    rate = np.concatenate([r for _, r, _ in found])
    adcp = np.concatenate([run.extra["speed_adcp"] for run, _, _ in found])
    speed = np.concatenate([s for _, _, s in found])
    out = {}
    for name, a, b in (("depth_rate", measured, rate), ("speed", adcp, speed)):
        good = np.isfinite(a) & np.isfinite(b)
        gap, whole = a[good] - b[good], a[good] - a[good].mean()
        out[f"{name}_r2"] = float(1.0 - (gap @ gap) / (whole @ whole))
        out[f"{name}_rmse_m_s"] = float(np.sqrt(np.mean(gap**2)))
    return out


def study(data: Path, out: Path, say: Callable[[str], None] = print) -> dict:
    """Fit on the first half, predict the second, ask what is missing; return the figures."""
    out.mkdir(parents=True, exist_ok=True)
    first, second = halves(data, out)
    model = load(HERE / "glider.yaml")
    result: dict = {"dives": [len(first.runs), len(second.runs)], "samples": [first.samples, second.samples]}
    result["as_given"] = scores(predicted_rate(model, second))
    made, values = fitted(model, first)
    predicted = predicted_rate(made, second)
    result["fitted"] = {**scores(predicted), "parameters": values}
    np.savez(
        out / "predicted.npz",
        **{f"{k}_{run.number}": x for run, *two in predicted for k, x in zip(KEPT, two, strict=True)},
    )
    _write(result, out)
    found = diagnose(model, first, whiteness=False, advice=False, costs=False, progress=say)
    result["diagnosis"] = {
        "verdict": found.verdict,
        "missing": list(found.missing),
        "steps": found.steps,
        "warnings": found.warnings,
        "candidates": [
            {k: c[k] for k in ("effect", "p_value", "explained", "parameters", "confusable_with")}
            for c in found.candidates[:5]
        ],
    }
    _write(result, out)
    made, values = fitted(model, first, ("compressibility",))
    result["with_compressibility"] = {**scores(predicted_rate(made, second)), "parameters": values}
    return result


def plain(value: Any) -> Any:
    """Return a result without numbers that JSON has not: what is unknown is null."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def _write(result: dict, out: Path) -> None:
    (out / "result.json").write_text(json.dumps(plain(result), indent=1, allow_nan=False) + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 2 or not (Path(sys.argv[1]) / FILE).is_file():
        sys.exit(f"give the folder that holds {FILE}")
    folder = Path(sys.argv[2] if len(sys.argv) > 2 else "outputs/glider")
    answer = study(Path(sys.argv[1]), folder)
    _write(answer, folder)
    print(json.dumps(plain(answer), indent=1))
