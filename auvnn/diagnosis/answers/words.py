"""The diagnosis in plain words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from auvnn.effects import EFFECTS

if TYPE_CHECKING:
    from auvnn.diagnosis.answers.answer import Diagnosis


MOTIONS = {"X": "surge", "Y": "sway", "Z": "heave", "K": "roll", "M": "pitch", "N": "yaw"}


def number(value: float | None, std: float | None, unit: str) -> str:
    """Return a value with its standard error and unit, to as many digits as the error deserves."""
    shown = "" if unit == "1" else f" {unit}"
    if value is None or not np.isfinite(value):
        return f"unknown{shown}"
    if std is None or not np.isfinite(std) or std <= 0:
        return f"{value:.4g}{shown}"
    digits = int(np.clip(1 - np.floor(np.log10(std)), 0, 9))
    return f"{value:.{digits}f} +- {std:.{digits}f}{shown}"


def parameters(candidate: dict[str, Any]) -> str:
    """Return a candidate's parameters on one line."""
    return ", ".join(
        f"{n} {number(p['value'], p['std'], p['unit'])}" for n, p in candidate["parameters"].items()
    )


def stochastic(left: dict[str, dict[str, float]]) -> str:
    """Return the stochastic force that is left as a sentence."""
    parts = [
        f"{MOTIONS[axis]} {told['rms']:.2g} {'N' if axis in 'XYZ' else 'N m'} over {told['correlation_time']:.2g} s"
        for axis, told in left.items()
    ]
    return f"A stochastic force is left (rms, correlation time): {', '.join(parts)}."


def tell(diagnosis: Diagnosis) -> list[str]:
    """Return the diagnosis as a few sentences."""
    by_name = {c["effect"]: c for c in diagnosis.candidates}
    lines: list[str] = []
    gone = {e for step in diagnosis.steps if step["verdict"] == "withdrawn" for e in step["effects"]}
    if diagnosis.verdict == "adequate":
        return [
            f"Nothing is missing that this log can show: the model is adequate within its stated "
            f"uncertainties (global p = {diagnosis.global_p_value:.2g})."
        ]
    for step in diagnosis.steps:
        if step["verdict"] == "named":
            for name in [e for e in step["effects"] if e not in gone]:
                lines.append(f"Missing: {name} ({EFFECTS.get(name).cause}): {parameters(by_name[name])}.")
        elif step["verdict"] == "ambiguous":
            lines.append(
                "One of these is missing, and this log cannot tell which: " + ", ".join(step["effects"]) + "."
            )
        elif step["verdict"] == "withdrawn":
            lines.append(
                f"Withdrawn: {', '.join(step['effects'])}, which had stood in for what was found after it."
            )
        elif step["verdict"] == "unknown":
            lines.append(
                "Something is missing that no effect of the catalogue explains."
                if not lines
                else "What is left is not noise, and no further effect of the catalogue explains it."
            )
        elif lines:
            lines.append("With that the model is adequate: what is left looks like noise.")
    if diagnosis.nearest:
        one = len(diagnosis.nearest) == 1
        lines.append(
            f"{' and '.join(diagnosis.nearest)} {'comes' if one else 'come'} nearest, and "
            f"{'leaves' if one else 'leave'} too much of it to be the cause."
        )
    if diagnosis.acts_in:
        first, *others = (f"{MOTIONS[axis]} ({axis})" for axis in diagnosis.acts_in)
        also = f", and shows in {' and '.join(others)} too" if others else ""
        lines.append(f"It acts in {first}{also}.")
    if diagnosis.left:
        lines.append(stochastic(diagnosis.left))
    if diagnosis.commands and diagnosis.commands["between_samples"] != "held":
        lines.append(
            "Commands change between the log's samples: the mean of an interval was taken as "
            f"{1 - diagnosis.commands['share_of_next']:.0%} of its own sample's and "
            f"{diagnosis.commands['share_of_next']:.0%} of the next one's."
        )
    if diagnosis.depends_on:
        strong = []
        for axis, shares in diagnosis.depends_on.items():
            if shares:
                top = max(shares, key=lambda n: shares[n])
                if shares[top] >= 0.05:
                    strong.append(f"{axis} on {top} ({shares[top]:.0%})")
        if strong:
            lines.append("The remaining residual depends on: " + ", ".join(strong) + ".")
    return lines
