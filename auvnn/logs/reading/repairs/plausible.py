"""What no vehicle does, checked on reading: missing halves, impossible rates, commands beyond their range."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import InputError
from auvnn.logs.channels import VELOCITY, WRENCH
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.run import Run

Array = NDArray[np.float64]

_MAX_MISSING = 0.5
_MAX_RATE = 20.0  # rad/s, three turns per second
_MAX_SPEED = 50.0  # m/s
_COMMAND_SLACK = 1e-6
# Far beyond any vehicle, in the units of the block: such a sample is a fault of the file, not of the sea.
_ABSURD = {
    "nu": 1e3,
    "nu_dot": 1e6,
    "position": 1e8,
    "wrench": 1e9,
    "fins": 1e3,
    "altitude": 1e6,
    "voltage": 1e6,
    "ballast": 1e3,
    "density": 1e5,
    "moving_mass": 1e3,
}


def check_plausible(run: Run, where: str) -> tuple[Run, list[Repair]]:
    """Return the run without absurd samples, and their count.

    Raises:
        InputError: more than half of a required channel is missing, or its unit cannot be right.
    """
    _missing(run, where)
    _units(run, where)
    _commands(run, where)
    changes: dict[str, Any] = {}
    repairs = []
    for block, limit in _ABSURD.items():
        values = getattr(run, block)
        if values is not None and _reaches(values, limit):
            absurd = np.abs(values) > limit
            changes[block] = np.where(absurd, np.nan, values)
            what = f"values of '{block}' beyond {limit:.0e}, which no vehicle reaches, read as missing"
            repairs.append(Repair(what, where, int(absurd.sum()), "warning", "look for damage in the file"))
    if not changes:
        return run, repairs
    run = replace(run, **changes)
    _missing(run, where)
    return run, repairs


def _reaches(values: Array, limit: float) -> bool:
    """Say whether any value is beyond a limit to either side, without a copy of the values."""
    with np.errstate(invalid="ignore"):
        return bool(np.fmax.reduce(values, axis=None) > limit or np.fmin.reduce(values, axis=None) < -limit)


def _units(run: Run, where: str) -> None:
    if not _reaches(run.nu[:, :3], _MAX_SPEED) and not _reaches(run.nu[:, 3:], _MAX_RATE):
        return  # nor does any quantile of them
    typical = [float(np.nanquantile(np.abs(c), 0.99)) if np.isfinite(c).any() else 0.0 for c in run.nu.T]
    for name, value in zip(VELOCITY[3:], typical[3:], strict=True):
        if value > _MAX_RATE:
            raise InputError(f"{where}: '{name}' reaches {value:.4g} rad/s: in degrees? Mapping: rates: deg")
    for name, value in zip(VELOCITY[:3], typical[:3], strict=True):
        if value > _MAX_SPEED:
            unit, scale = ("mm/s", 0.001) if value > 400.0 else ("cm/s", 0.01)
            raise InputError(
                f"{where}: '{name}' reaches {value:.4g} m/s: in {unit}? "
                f"Mapping: columns: {{{name}: {{from: ..., scale: {scale}}}}}"
            )


def _commands(run: Run, where: str) -> None:
    if run.thrusters is None or not np.isfinite(run.thrusters).any():
        return
    largest = max(float(np.nanmax(run.thrusters)), -float(np.nanmin(run.thrusters)))
    if largest > 1.0 + _COMMAND_SLACK:
        kind = "PWM" if largest > 500.0 else "percent" if largest > 2.0 else "of another range"
        cure = "curve: {neutral: 1500, span: 400}" if kind == "PWM" else f"scale: {1.0 / largest:.3g}"
        raise InputError(
            f"{where}: thruster commands reach {largest:.4g}, beyond [-1, 1]: are they {kind}? "
            f"Mapping: columns: {{thruster_1: {{from: ..., {cure}}}}}"
        )


def _missing(run: Run, where: str) -> None:
    blocks = (run.nu, run.quaternion, run.thrusters if run.thrusters is not None else run.wrench)
    if all(np.isfinite(b.sum()) for b in blocks if b is not None):
        return
    needed = [*zip(VELOCITY, run.nu.T, strict=True), ("attitude", run.quaternion.sum(axis=1))]
    if run.thrusters is not None:
        needed += [(f"thruster_{i + 1}", c) for i, c in enumerate(run.thrusters.T)]
    elif run.wrench is not None:
        needed += list(zip(WRENCH, run.wrench.T, strict=True))
    for name, column in needed:
        share = float(np.isnan(column).mean())
        if share == 1.0 and name in (*VELOCITY, "attitude"):
            continue  # not measured at all, which a log may do without
        if share > _MAX_MISSING:
            raise InputError(
                f"{where}: {100 * share:.0f} % of the required channel '{name}' is missing (50 % may be): "
                "resample the log to the rate of its slowest channel, or cut it to where all are recorded"
            )
