"""Tables in which sensors of several rates stand in the same rows, with empty cells where one did not measure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.logs.channels import EULER, QUATERNION, VELOCITY, WRENCH
from auvnn.logs.reading.mapping_file.mapping import Mapping
from auvnn.logs.reading.recordings import rates
from auvnn.logs.reading.recordings.rates import Series
from auvnn.logs.reading.repairs import attitude
from auvnn.logs.reading.repairs.repair import Repair
from auvnn.logs.signals import differences

Array = NDArray[np.float64]

_MOST_MISSING = 0.5  # of a required column; of fewer the rows are simply left out


def settle(columns: dict[str, Array], plan: Mapping, where: str) -> tuple[dict[str, Array], list[Repair]]:
    """Return one run's columns at the times of its slowest velocity sensor, where the table holds several rates.

    Differences that the mapping asks for are taken here too.

    Args:
        columns: by canonical name, (N,) each, `t` among them in order; those outside the contract as well.
        plan: the mapping.
        where: file and run, for messages.
    """
    wanted = [n for n, c in plan.columns.items() if c.more.difference and n in columns]
    if wanted:
        columns = dict(columns)
        for name in wanted:
            middle, speed = differences.of_positions(columns["t"], columns[name][:, None])
            inside = rates.linear(middle, speed, columns["t"], np.inf) if len(middle) > 1 else None
            columns[name] = np.full(len(columns["t"]), np.nan) if inside is None else inside[:, 0]
    required = [n for n in columns if n in VELOCITY + QUATERNION + EULER + WRENCH or rates.is_command(n)]
    present = [n for n in required if not np.isnan(columns[n]).all()]
    if not rates.sparse(columns, present, _MOST_MISSING):
        return columns, []
    series = _with_quaternion(rates.of_table(columns), plan, where)
    rows = rates.rows_of(series, None, where)
    steps = sorted({round(1.0 / s.step, 2) for s in series if np.isfinite(s.step)})
    out, repairs = rates.merge(series, rows, where, plan.commands.between, plan.commands.longest)
    for name in columns:
        if name not in out and name not in EULER:
            out[name] = np.full(len(out["t"]), np.nan)
    told = ", ".join(f"{r:g}" for r in steps)
    words = (
        f"columns of several rates ({told} Hz) brought to the times of {rows.topic}, {1 / rows.step:.3g} Hz"
    )
    return out, [Repair(words, where, len(out["t"]), "info"), *repairs]


def _with_quaternion(series: list[Series], plan: Mapping, where: str) -> list[Series]:
    """Return the series with angles as quaternions, which can be interpolated, in the frames of the table."""
    out = []
    for one in series:
        if set(one.names) == set(EULER):
            angles = np.stack([one.values[:, one.names.index(n)] for n in EULER], axis=1)
            q = attitude.from_angles(angles, one.t, np.zeros(len(one.t)), where)[0]
            one = Series(QUATERNION, one.t, q, one.topic)
        elif set(one.names) == set(QUATERNION):
            one = Series(
                QUATERNION,
                one.t,
                np.stack([one.values[:, one.names.index(n)] for n in QUATERNION], axis=1),
                one.topic,
            )
        out.append(one)
    return out
