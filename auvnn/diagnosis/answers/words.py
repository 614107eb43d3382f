"""The diagnosis in plain words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from auvnn.answer_types import Parameters
from auvnn.diagnosis.answers import judged_words
from auvnn.diagnosis.answers.moved_coefficients import moved_words
from auvnn.diagnosis.answers.refitted_coefficients import above_all, refitted_words
from auvnn.diagnosis.noise_law.words import stochastic_words
from auvnn.effects import EFFECTS

if TYPE_CHECKING:
    from auvnn.diagnosis.answers.answer import Diagnosis


MOTIONS = judged_words.MOTIONS


def number(value: float | None, std: float | None, unit: str) -> str:
    """Return a value with its standard error and unit, to as many digits as the error deserves.

    Args:
        value: in `unit`; "unknown" where it is None or not finite.
        std: its standard error; four digits are shown where it is unknown.
        unit: SI; "1" is left out.
    """
    shown = "" if unit == "1" else f" {unit}"
    if value is None or not np.isfinite(value):
        return f"unknown{shown}"
    if std is None or not np.isfinite(std) or std <= 0:
        return f"{value:.4g}{shown}"
    digits = int(np.clip(1 - np.floor(np.log10(std)), 0, 9))
    return f"{value:.{digits}f} +- {std:.{digits}f}{shown}"


def parameters(values: Parameters) -> str:
    """Return an effect's parameters on one line."""
    return ", ".join(f"{n} {number(p['value'], p['std'], p['unit'])}" for n, p in values.items())


def tell(diagnosis: Diagnosis) -> list[str]:
    """Return the diagnosis as a few sentences."""
    by_name = {c["effect"]: c for c in diagnosis.candidates}
    lines: list[str] = []
    gone = {e for step in diagnosis.steps if step["verdict"] == "withdrawn" for e in step["effects"]}
    if diagnosis.verdict == "adequate":
        return [
            _adequate(diagnosis),
            *refitted_words(diagnosis.refitted),
            *judged_words.left(diagnosis),
            *(moved_words(diagnosis.moved) if diagnosis.refitted is None else []),
        ]
    if diagnosis.verdict == "partial":
        return [
            "Something is missing that no effect of the catalogue explains as a whole.",
            *judged_words.predicts(diagnosis),
            *_where(diagnosis),
            *judged_words.left(diagnosis),
            *_dependence(diagnosis),
            *moved_words(diagnosis.moved),
        ]
    for step in diagnosis.steps:
        if step["verdict"] == "named":
            for name in [e for e in step["effects"] if e not in gone]:
                lines.append(_named(name, by_name[name]["parameters"], diagnosis.stated.get(name)))
        elif step["verdict"] == "ambiguous":
            missing = (
                "missing, or has another value," if {*step["effects"]} & {*diagnosis.stated} else "missing,"
            )
            lines.append(
                f"One of these is {missing} and this log cannot tell which: {', '.join(step['effects'])}."
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
            also = f", and with {', '.join(diagnosis.unsure)} (see the warnings)," if diagnosis.unsure else ""
            left = "does not matter within the tolerance" if diagnosis.small_remainder else "looks like noise"
            lines.append(f"With that{also} the model is adequate: what is left {left}.")
    lines += judged_words.costs(diagnosis)
    if diagnosis.nearest:
        one = len(diagnosis.nearest) == 1
        lines.append(
            f"{_series(diagnosis.nearest)} {'comes' if one else 'come'} nearest, and "
            f"{'leaves' if one else 'leave'} too much of it to be the cause."
        )
    off = refitted_words(diagnosis.refitted, diagnosis.matters)
    # What costs the predictions most is told first.
    lines = [*off, *lines] if above_all(diagnosis.refitted, diagnosis.matters) else [*lines, *off]
    return [
        *lines,
        *_where(diagnosis),
        *judged_words.left(diagnosis),
        *stochastic_words(diagnosis.stochastic),
        *_dependence(diagnosis),
        *(moved_words(diagnosis.moved) if diagnosis.refitted is None else []),
    ]


def _named(name: str, values: Parameters, stated: Mapping[str, float] | None) -> str:
    """Say that an effect is missing, or, where the model has it, that it has other values there."""
    what = f"{name} ({EFFECTS.get(name).cause})"
    if stated is None:
        return f"Missing: {what}: {parameters(values)}."
    told = ", ".join(
        f"{n} {number(p['value'], p['std'], p['unit'])}, where the model has {number(stated[n], None, p['unit'])}"
        for n, p in values.items()
    )
    return f"Other than the model states: {what}: {told}."


def _adequate(diagnosis: Diagnosis) -> str:
    if diagnosis.small_remainder:
        return "Nothing is missing that matters within the tolerance."
    return (
        f"Nothing is missing that this log can show: the model is adequate within its stated "
        f"uncertainties (global p = {diagnosis.global_p_value:.2g})."
    )


def _where(diagnosis: Diagnosis) -> list[str]:
    """Say where the force that is left acts."""
    if not diagnosis.acts_in or diagnosis.small_remainder:
        return []
    first, *others = (f"{MOTIONS[axis]} ({axis})" for axis in diagnosis.acts_in)
    also = f", and shows in {_series(others)} too" if others else ""
    what = "What is left" if diagnosis.missing or diagnosis.joint else "It"
    return [f"{what} acts in {first}{also}."]


def _dependence(diagnosis: Diagnosis) -> list[str]:
    """Say on which measured inputs what is left depends."""
    strong = []
    for axis, shares in diagnosis.depends_on.items():
        if shares:
            top = max(shares, key=lambda n: shares[n])
            if shares[top] >= 0.05:
                strong.append(f"{axis} on {top}{_inseparable(diagnosis, axis, top)} ({shares[top]:.0%})")
    if not strong and any(diagnosis.depends_on.values()):
        axis = max(diagnosis.depends_on, key=lambda a: max(diagnosis.depends_on[a].values(), default=0.0))
        top = max(diagnosis.depends_on[axis], key=lambda n: diagnosis.depends_on[axis][n])
        strong = [f"{axis} on {top} (surely, though for a small part of it)"]
    return ["The remaining residual depends on: " + ", ".join(strong) + "."] if strong else []


def _inseparable(diagnosis: Diagnosis, axis: str, top: str) -> str:
    """Say which inputs the log cannot tell from one that is named."""
    for group in diagnosis.inseparable.get(axis, []):
        if top in group:
            return f", which this log cannot tell from {_series([n for n in group if n != top], 'or')}"
    return ""


def _series(names: list[str], last: str = "and") -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {last} {names[-1]}"
