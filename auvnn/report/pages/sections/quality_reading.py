"""A quality report, read as its plots take it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from auvnn.report.pages import common
from auvnn.report.panels import NoData
from auvnn.report.style import VELOCITY
from auvnn.report.view import View

LEVELS = ("error", "warning", "repair", "info")
_GROUPS = (
    (r"q[wxyz]", "attitude"),
    (r"d[uvwpqr]", "accelerations"),
    (r"[xyz]", "position"),
    (r"tau_[XYZKMN]", "wrench"),
    (r"thruster_\d+", "thrusters"),
    (r"fin_\d+", "fins"),
)
MOST_ROWS = 24


def plain_of(view: View, name: str) -> Mapping[str, Any]:
    """Return a mapping of the JSON answer, where the attribute holds objects."""
    value = view.data.get(name)
    return value if isinstance(value, Mapping) else view.mapping(name)


def findings(view: View) -> list[Mapping[str, Any]]:
    """Return the findings as mappings, errors first."""
    found = view.data.get("findings") or view.items("findings")
    found = [f if isinstance(f, Mapping) else vars(f) for f in found]
    return sorted(found, key=lambda f: LEVELS.index(f["level"]) if f.get("level") in LEVELS else len(LEVELS))


def checks(view: View) -> list[dict[str, Any]]:
    """Return the kinematic checks as the plot takes them."""
    found = plain_of(view, "kinematics")
    rows = [
        {
            "channel": name,
            "slope": a.get("scale", a.get("slope")),
            **{k: a.get(k) for k in ("correlation", "std")},
        }
        for name, a in found.items()
        if isinstance(a, Mapping)
    ]
    return sorted(rows, key=lambda row: _order(row["channel"]))


def motion(view: View) -> list[dict[str, Any]]:
    """Return the excitation as the plot takes it."""
    found = plain_of(view, "excitation")
    found = found.get("directions", found)
    units = dict(VELOCITY)
    rows = [
        {
            "channel": name,
            "std": e.get("std"),
            "noise": e.get("noise_std", e.get("noise")),
            "ratio": e.get("signal_to_noise", e.get("ratio")),
            "unit": units.get(name, ""),
        }
        for name, e in found.items()
        if isinstance(e, Mapping)
    ]
    return sorted(rows, key=lambda row: _order(row["channel"]))


def _order(channel: str) -> tuple[int, str]:
    return (common.CHANNELS.index(channel) if channel in common.CHANNELS else len(common.CHANNELS), channel)


def tracks(view: View) -> list[dict[str, Any]]:
    """Return the runs' channels as the plot takes them."""
    runs = getattr(view.get("log"), "runs", None)
    if not runs:
        raise NoData("the answer holds no samples")
    return [{"run": r.number, "t": r.t, "channels": _grouped(r)} for r in runs]


def _grouped(run: Any) -> dict[str, np.ndarray]:
    """Join what one sensor gives: a group has a value where all its members have one."""
    out: dict[str, np.ndarray] = {}
    extra = getattr(run, "extra", None) or {}
    for name, values in run.columns():
        if name == "t":
            continue
        group = next((g for pattern, g in _GROUPS if re.fullmatch(pattern, name)), name)
        group = "other columns" if name in extra else group
        there = np.where(np.isfinite(np.asarray(values, dtype=float)), 0.0, np.nan)
        out[group] = there + out[group] if group in out else there
    order = ["attitude", *common.CHANNELS, "accelerations", "position", "wrench", "thrusters", "fins"]
    names = [n for n in order if n in out] + [n for n in out if n not in order]
    return {n: out[n] for n in names[:MOST_ROWS]}
