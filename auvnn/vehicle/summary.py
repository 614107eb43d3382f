"""A vehicle's numbers as a person reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from auvnn.cards import Text
from auvnn.vehicle.checks import DOF

if TYPE_CHECKING:
    from auvnn.vehicle.vehicle import Vehicle


def summary(vehicle: Vehicle) -> Text:
    """Return a few lines: weight and buoyancy, centres, inertia, damping, actuators, uncertainty, what is doubtful."""
    v = vehicle
    net = v.buoyancy - v.weight
    # mass * gravity seldom meets the stated buoyancy to the last digit.
    net = 0.0 if abs(net) < 1e-9 * v.weight else net
    floats = "floats up" if net > 0 else "sinks" if net < 0 else "neutral"
    height = float(v.center_of_gravity[2] - v.center_of_buoyancy[2])
    upright = "upright at rest" if height > 0 else "not upright at rest"
    rows = [
        ("mass", f"{v.mass:.6g} kg; length {v.length:.4g} m"),
        ("weight, buoyancy", f"{v.weight:.6g} N, {v.buoyancy:.6g} N: {net:+.4g} N, {floats}"),
        ("centre of gravity", f"{_list(v.center_of_gravity)} m; of buoyancy {_list(v.center_of_buoyancy)} m"),
        ("", f"gravity {height:.4g} m below buoyancy, {upright}"),
        ("inertia", f"{_diagonal(v.inertia)} kg m2 about the centre of gravity"),
        ("added mass", f"{_axes(v.added_mass)} (kg, kg m2)"),
        ("linear damping", _damping(v.linear_damping, "N s/m, N m s")),
        ("quadratic damping", _damping(v.quadratic_damping, "N s2/m2, N m s2")),
    ]
    if v.damping_elements:
        count = len(v.damping_elements)
        parts = "part at an offset centre" if count == 1 else "parts at offset centres"
        rows.append(("damping elements", f"{count} {parts}"))
    rows += [("thrusters", _thrusters(v)), ("fins", f"{v.n_fins}" if v.fins else "none")]
    rows.append(
        ("uncertainty", ", ".join(f"{k} {100 * s:g} %" for k, s in v.uncertainty.items() if s) or "none")
    )
    for name, values in v.effects.items():
        stated = ", ".join(f"{k} {x:.4g}" for k, x in values.items() if isinstance(x, (int, float)))
        rows.append(("effect", f"{name}: {stated}" if stated else name))
    rows += [("source", v.source)] if v.source else []
    rows += [("doubtful", w) for w in v.warnings]
    width = max(len(name) for name, _ in rows)
    return Text("\n".join([v.name, *(f"  {name:<{width}}  {words}" for name, words in rows)]))


def _list(values: Any) -> str:
    return "[" + ", ".join(f"{x:.4g}" for x in values) + "]"


def _coupled(matrix: Any) -> str:
    off = np.asarray(matrix) - np.diag(np.diag(matrix))
    count = int((off != 0).sum())
    return f"; {count} terms off the diagonal" if count else ""


def _diagonal(matrix: Any) -> str:
    return _list(np.diag(matrix)) + _coupled(matrix)


def _axes(matrix: Any) -> str:
    return ", ".join(f"{a} {x:.4g}" for a, x in zip(DOF, np.diag(matrix), strict=True)) + _coupled(matrix)


def _damping(matrix: Any, units: str) -> str:
    return "none stated" if matrix is None else f"{_axes(matrix)} ({units})"


def _thrusters(vehicle: Vehicle) -> str:
    if not vehicle.thrusters:
        return "none: the log must carry the wrench, tau_X ... tau_N"
    forward = np.zeros(6)
    for t in vehicle.thrusters:
        force = np.asarray(t.direction, dtype=float)
        arm = np.concatenate([force, np.cross(np.asarray(t.position, dtype=float), force)])
        # Each thruster pushes whichever way serves the axis.
        forward += np.maximum(arm * t.max_forward, -arm * t.max_reverse)
    reach = ", ".join(f"{a} {x:.3g}" for a, x in zip(DOF, forward, strict=True))
    return f"{vehicle.n_thrusters}; most along each axis: {reach} (N, N m)"
