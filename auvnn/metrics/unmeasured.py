"""Where free running starts where a vehicle has no sensor for it: estimates of what a log lacks.

They are starting points and nothing else: no fit, test or score counts them as measurements. Rates follow from measured
attitudes, velocities from measured positions. Where there is neither, the model itself is run along the log, turned as
the measured attitude and rates turn and moved up and down as the measured depth moves:

    M v_dot = ...(v, omega measured),    v <- v + P n (z_dot - n . v) / (n . P n),    n = R^T e_z,

P being the directions in which velocity was not measured. That is an observer: errors of its start die away with the
drag. Reference: Fossen (2021), Handbook of Marine Craft, 2nd ed., section 14.4 (observers that need no velocity).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs import Log, Run
from auvnn.logs.channels import EULER, VELOCITY
from auvnn.logs.signals.derivatives import LocalPolynomial
from auvnn.logs.signals.rotation import body_rates, conjugate, continuous, from_euler, rotate
from auvnn.metrics.gliding import driven, in_plane
from auvnn.metrics.one_step import OneStepReplay
from auvnn.models import GreyBox, Inputs

Array = NDArray[np.float64]
# Seconds on either side over which positions and attitudes are differentiated, and least number of samples.
AROUND, LEAST = 0.4, 3
# The observer works on stretches of a run at once, s, each after so many seconds in which its start is forgotten.
STRETCH, FORGET = 20.0, 25.0
# Its longest step, s, and the fastest velocity that it believes, m/s.
STEP, FASTEST = 0.1, 5.0
# A vertical that lies this little in the directions that were not measured says nothing of them.
ACROSS = 0.05
DOWN = np.array([0.0, 0.0, 1.0])


def completed(model: GreyBox, log: Log) -> Log:
    """Return the log with estimates of what it has no sensor for, marked as such; itself where nothing is missing.

    Args:
        model: as known; with another model the estimates would differ, which fits and scores make up for.
        log: the log.

    Raises:
        InputError: neither attitude nor position was measured.
    """
    if log.estimated:
        return log
    vehicle = model.vehicle
    if not (log.unmeasured or vehicle.reduced or vehicle.glides):
        return log
    absent = tuple(n for n in log.unmeasured if n in VELOCITY)
    attitude = "attitude" in log.unmeasured
    runs = [_turned(run, attitude) for run in log.runs]
    runs = [driven(in_plane(run, model), model) for run in runs]
    marks = (*absent, *(EULER if attitude else ()))
    if any(n in absent for n in VELOCITY[:3]):
        positioned = [r.position is not None and np.isfinite(r.position).any(0).all() for r in runs]
        runs = [_from_positions(r, absent) if p else r for r, p in zip(runs, positioned, strict=True)]
        rest = [k for k, p in enumerate(positioned) if not p]
        for k, run in zip(rest, _observed(model, [runs[k] for k in rest], absent), strict=True):
            runs[k] = run
    return replace(
        log,
        runs=tuple(
            replace(run, estimated=tuple(dict.fromkeys((*marks, *run.estimated))), recorded=recorded)
            for run, recorded in zip(runs, log.runs, strict=True)
        ),
    )


def assumed(log: Log, model: GreyBox | None = None) -> list[str]:
    """Return in a line each what is assumed for what has no sensor, and what a reduced model leaves out.

    Args:
        log: as recorded, or completed.
        model: that it is compared with.
    """
    found = []
    if log.unmeasured:
        found.append(
            f"{', '.join(log.unmeasured)} not measured: where each window starts is estimated with the fit, and only "
            "what was measured counts in tests, scores and intervals"
        )
    if model is None:
        return found
    vehicle = model.vehicle
    if vehicle.reduced.plane != "full":
        left = "surge, heave and pitch" if vehicle.reduced.plane == "vertical" else "surge, sway and yaw"
        found.append(f"{vehicle.name} moves in the {vehicle.reduced.plane} plane: {left} alone count")
    if vehicle.reduced.attitude == "measured":
        found.append(f"{vehicle.name} is turned by the measured attitude: nothing is said of moments")
    if vehicle.ballast is not None and all("density" not in run.channels for run in log.runs):
        found.append(f"no density measured: {vehicle.water_density:g} kg/m3 throughout")
    return found


def _slope(run: Run, values: Array) -> tuple[Array, Array]:
    """Return smoothed values and their derivatives, gaps of single samples bridged, (N, k) each."""
    width = max(LEAST, round(AROUND / run.dt))
    width = min(width, max((run.samples - 1) // 2, 1))
    filled = values.copy()
    for k in range(values.shape[1]):
        seen = np.isfinite(values[:, k])
        if seen.any():
            filled[:, k] = np.interp(run.t, run.t[seen], values[seen, k])
    return LocalPolynomial(run.t, width, min(2, 2 * width), np.inf)(filled)


def _turned(run: Run, no_attitude: bool) -> Run:
    """Return the run with an attitude and with rates: level and along its course where no attitude was measured."""
    if no_attitude:
        if run.position is None or not np.isfinite(run.position[:, :2]).any(0).all():
            raise InputError(
                f"run {run.number}: neither attitude nor position was measured: nothing can be seen of its motion"
            )
        course = _slope(run, run.position)[1]
        heading = np.unwrap(np.arctan2(course[:, 1], course[:, 0]))
        angles = np.stack([np.zeros_like(heading), np.zeros_like(heading), heading], axis=1)
        run = replace(run, quaternion=from_euler(angles))
    absent = np.isnan(run.nu[:, 3:]).all(0)
    if not absent.any():
        return run
    smooth, rate = _slope(run, continuous(run.quaternion))
    nu = run.nu.copy()
    nu[:, 3:] = np.where(absent, body_rates(smooth, rate), nu[:, 3:])
    return replace(run, nu=nu)


def _from_positions(run: Run, absent: tuple[str, ...]) -> Run:
    assert run.position is not None
    velocity = rotate(conjugate(run.quaternion), _slope(run, run.position)[1])
    nu = run.nu.copy()
    gone = np.array([n in absent for n in VELOCITY[:3]])
    nu[:, :3] = np.where(gone, velocity, nu[:, :3])
    return replace(run, nu=nu)


@dataclass(frozen=True)
class _Piece:
    """Rows of one run that are observed together, the first of which only serve to forget the start."""

    run: int
    first: int
    begin: int
    end: int


def _observed(model: GreyBox, runs: list[Run], absent: tuple[str, ...]) -> list[Run]:
    """Return the runs with the velocities that the model has when it is turned as they turn."""
    if not runs:
        return []
    model = model.without_absent()
    gone = np.array([n in absent for n in VELOCITY[:3]])
    known = [_known(run) for run in runs]
    replays = [OneStepReplay(model, run) for run in known]
    vertical = [None if r.position is None else _slope(r, r.position[:, 2:])[1][:, 0] for r in known]
    pieces = [p for k, run in enumerate(known) for p in _pieces(k, run)]
    longest = max(p.end - p.first for p in pieces)
    index = [np.minimum(np.arange(p.first, p.first + longest), p.end - 1) for p in pieces]

    def gather(each: list) -> torch.Tensor:
        return torch.stack([torch.as_tensor(each[p.run])[i] for p, i in zip(pieces, index, strict=True)])

    rotation, rates = gather([r.rotation for r in replays]), gather([r.state.nu for r in replays])
    position, thrust = gather([r.state.position for r in replays]), gather([r.mean for r in replays])
    times = gather([r.times for r in replays])
    inputs = _joined(replays, pieces, index)
    sink = gather(
        [np.full(r.samples, np.nan) if v is None else v for r, v in zip(known, vertical, strict=True)]
    )
    normal, free = rotation[..., 2, :], torch.as_tensor(gone, dtype=torch.float64)
    along = (normal * normal * free).sum(-1)
    velocity = torch.nan_to_num(rates[:, 0, :3])
    found = []
    prepared = None if model.time_varying else model.prepare()
    with torch.no_grad():
        for k in range(longest):
            velocity = torch.where(free > 0, velocity, rates[:, k, :3])
            lift = (sink[:, k] - (normal[:, k] * velocity).sum(-1)) / along[:, k].clamp(min=ACROSS)
            lift = torch.where((along[:, k] > ACROSS) & torch.isfinite(lift), lift, torch.zeros_like(lift))
            velocity = (velocity + lift[:, None] * normal[:, k] * free).clamp(-FASTEST, FASTEST)
            found.append(velocity)
            if k == longest - 1:
                break
            row = inputs[k]
            whole = (times[:, k + 1] - times[:, k]).clamp(min=0.0, max=5.0)
            count = max(1, int(np.ceil(float(whole.max()) / STEP)))
            for _ in range(count):
                nu = torch.cat([velocity, rates[:, k, 3:]], dim=-1)
                rate = model.nu_dot(
                    position[:, k], rotation[:, k], nu, thrust[:, k], row, times[:, k], prepared
                )
                velocity = torch.nan_to_num(velocity + (whole / count)[:, None] * rate[:, :3])
                velocity = velocity.clamp(-FASTEST, FASTEST)
    told = torch.stack(found, dim=1).numpy()
    out = []
    for k, run in enumerate(runs):
        nu = run.nu.copy()
        for piece, own in zip(pieces, told, strict=True):
            if piece.run == k:
                rows = slice(piece.begin, piece.end)
                values = own[piece.begin - piece.first : piece.end - piece.first]
                nu[rows, :3] = np.where(gone, values, nu[rows, :3])
        out.append(replace(run, nu=nu))
    return out


def _known(run: Run) -> Run:
    """Return the run without a gap in what turns it, so that the observer need not stop at one."""
    nu = run.nu.copy()
    nu[:, :3] = np.nan_to_num(nu[:, :3])
    for k in range(3, 6):
        nu[:, k] = _bridged(run.t, nu[:, k])
    quaternion = np.stack([_bridged(run.t, c) for c in continuous(run.quaternion).T], axis=1)
    size = np.linalg.norm(quaternion, axis=1, keepdims=True)
    quaternion = quaternion / np.where(size > 1e-9, size, 1.0)
    return replace(run, nu=nu, quaternion=quaternion)


def _bridged(t: Array, x: Array) -> Array:
    seen = np.isfinite(x)
    return np.interp(t, t[seen], x[seen]) if seen.any() else np.zeros_like(x)


def _pieces(number: int, run: Run) -> list[_Piece]:
    edges = np.searchsorted(run.t, np.arange(run.t[0], run.t[-1], STRETCH))
    ends = [*edges[1:].tolist(), run.samples]
    found = []
    for begin, end in zip(edges.tolist(), ends, strict=True):
        if end > begin:
            first = int(np.searchsorted(run.t, run.t[begin] - FORGET))
            found.append(_Piece(number, first, begin, end))
    return found


def _joined(replays: list[OneStepReplay], pieces: list[_Piece], index: list[Array]) -> list:
    """Return the inputs of all pieces row by row."""

    def stacked(name: str) -> torch.Tensor | None:
        values = [getattr(r.inputs, name) for r in replays]
        if any(v is None for v in values):
            return None
        return torch.stack([values[p.run][i] for p, i in zip(pieces, index, strict=True)])

    names = ("command", "fins", "voltage", "altitude")
    return Inputs(*(stacked(n) for n in names)).each()  # type: ignore[arg-type]
