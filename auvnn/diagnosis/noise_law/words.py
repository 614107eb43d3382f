"""What was found of a stochastic force, of the noise, and of commands between samples, in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from auvnn.diagnosis.residuals.input_forces import AXES
from auvnn.metrics.force_law import ForceLaw
from auvnn.models.actuation.command_path import CommandPath

MOTIONS = {"X": "surge", "Y": "sway", "Z": "heave", "K": "roll", "M": "pitch", "N": "yaw"}


def stochastic_words(stochastic: Mapping[str, Any]) -> list[str]:
    """Return the sentences; none where nothing was asked or found."""
    lines: list[str] = []
    if stochastic.get("force"):
        parts = [
            f"{MOTIONS[axis]} {told['rms']:.2g} {'N' if axis in 'XYZ' else 'N m'} over {told['correlation_time']:.2g} s"
            for axis, told in stochastic["force"].items()
        ]
        lines.append(f"A stochastic force is left (rms, correlation time): {', '.join(parts)}.")
    if stochastic.get("noise"):
        times = ", ".join(f"{name} {time:.2g} s" for name, time in stochastic["noise"].items())
        lines.append(f"The sensors' noise is not white; its correlation times: {times}.")
    commands = stochastic.get("commands")
    if commands and commands["between_samples"] != "held":
        given = {n: commands[n] for n in ("samples", "interpolated") if n in commands}
        path = CommandPath(commands["between_samples"], commands["share_of_next"], 1.0, **given)
        lines.append(f"{path.words()} The model states it." if commands.get("stated") else path.words())
    uncertain = {a: v for a, v in (commands or {}).get("uncertain", {}).items() if v > 0.0}
    if uncertain:
        sizes = [f"{MOTIONS[a]} {v:.2g} {'N' if a in 'XYZ' else 'N m'}" for a, v in uncertain.items()]
        lines.append(f"What commands are between samples leaves a force uncertain (rms): {', '.join(sizes)}.")
    return lines


def left(law: ForceLaw | None) -> dict[str, dict[str, float]]:
    """Return a law as answers hold it: by degree of freedom rms, N or N m, and correlation time, s."""
    if law is None:
        return {}
    return {AXES[i]: {"rms": float(law.rms[i]), "correlation_time": float(law.time[i])} for i in law.axes}
