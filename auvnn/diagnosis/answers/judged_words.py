"""In words: what each name costs, what predicts without being the cause, what is left, and what would have shown."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeGuard

import numpy as np

if TYPE_CHECKING:
    from auvnn.diagnosis.answers.answer import Diagnosis

MOTIONS = {"X": "surge", "Y": "sway", "Z": "heave", "K": "roll", "M": "pitch", "N": "yaw"}
# Degrees of freedom of a force that the words name, and the least share that is worth a word.
NAMED, WORTH_A_WORD = 3, 0.05


def costs(diagnosis: Diagnosis) -> list[str]:
    """Return a sentence for each name with what it costs and how large its force is."""
    out = []
    for name in [*diagnosis.missing, *(n for n in diagnosis.matters if n not in diagnosis.missing)]:
        entry = diagnosis.matters.get(name)
        if entry is None:
            continue
        there = name in diagnosis.stated
        without, whose = (
            ("with the values that the model has,", "the force of the change")
            if there
            else ("without it", "its force")
        )
        parts = []
        if _known(entry["cost"]):
            parts.append(f"{without} the error of free running on runs left out is {_change(entry['cost'])}")
        worst = entry.get("worst")
        if worst and _known(worst["cost"]):
            parts.append(f"in {worst['velocity']} it is {_change(worst['cost'])}")
        strongest = _largest(entry["force"])
        if strongest:
            share = f", up to {_share(entry['share'])} of the actuators'" if _known(entry["share"]) else ""
            parts.append(f"{whose} is {strongest} (rms){share}")
        if not parts:
            continue
        verdict = "" if entry["matters"] else " It is there and does not matter within the tolerance."
        out.append(f"{name}: {'; '.join(parts)}.{verdict}")
    return out


def predicts(diagnosis: Diagnosis) -> list[str]:
    """Return what is said of names that predict without being the cause."""
    names = list(diagnosis.joint)
    if not names:
        return []
    if len(names) > 1:
        claim = f"{_listed(names)} together predict a part of what is missing; that they are its cause is not claimed"
    else:
        claim = f"{names[0]} predicts a part of what is missing; that it is its cause is not claimed"
    out = [f"{claim}: too much is left for that."]
    for name, entry in diagnosis.joint.items():
        shares = {a: s for a, s in entry["explained_by_dof"].items() if s >= WORTH_A_WORD}
        where = ", ".join(f"{s:.0%} in {MOTIONS[a]}" for a, s in sorted(shares.items(), key=lambda x: -x[1]))
        words = (
            f"{name} explains {where} of the force" if where else f"{name} alone explains little of the force"
        )
        if entry["gain"] is not None:
            gain = entry["gain"]
            verb = "lowers" if gain["value"] > 0 else "raises"
            words += (
                f", and in addition to the others {verb} the error of free running on runs left out by "
                f"{abs(gain['value']):.3g} +- {gain['std']:.2g}"
            )
        out.append(words + ".")
        out += [f"Mind that {words}." for words in entry["confounded_with"]]
    return out


def left(diagnosis: Diagnosis) -> list[str]:
    """Return what is said of the force that is left, or of the smallest that would have shown."""
    by_axis = {a: v for a, v in diagnosis.left.items() if a in MOTIONS}
    if not by_axis:
        return []
    acting = [a for a in diagnosis.acts_in if a in by_axis and by_axis[a]["rms"] > 0]
    if diagnosis.small_remainder and acting:
        told = _listed([f"{_size(by_axis[a]['rms'], a)} in {MOTIONS[a]}" for a in acting[:NAMED]])
        return [f"A small remainder of {told} is left, which does not matter within the tolerance."]
    if diagnosis.verdict == "adequate" and not diagnosis.small_remainder:
        told = [
            f"{_size(v['detectable'], a)} in {MOTIONS[a]}"
            for a, v in by_axis.items()
            if _known(v["detectable"])
        ]
        return (
            [f"A lasting or slow force would have shown in this log from {_listed(told)} on."] if told else []
        )
    if acting and diagnosis.steps[-1]["verdict"] in ("unknown", "partial"):
        told = _listed([f"{_size(by_axis[a]['rms'], a)} in {MOTIONS[a]}" for a in acting[:NAMED]])
        cost = diagnosis.left.get("cost")
        more = ""
        if _known(cost):
            above = (
                "is not above the noise floor"
                if cost <= 0.0
                else f"is {_change(cost)} compared with the noise floor"
            )
            more = f"; the error of free running {above}"
        return [f"What is left amounts to a force of {told} rms{more}."]
    return []


def _known(value: Any) -> TypeGuard[float]:
    return value is not None and bool(np.isfinite(value))


def _change(cost: float) -> str:
    if cost >= 1.0:
        return f"{_two_digits(1.0 + cost)} times as large"
    return f"{_share(abs(cost))} {'larger' if cost >= 0 else 'smaller'}"


def _two_digits(value: float) -> str:
    """Return a number to two digits, from a hundred on without an exponent."""
    return f"{value:.2g}" if value < 99.5 else f"{value:.0f}"


def _share(share: float) -> str:
    return f"{_two_digits(100.0 * share)}%"


def _size(value: float, axis: str) -> str:
    return f"{value:.2g} {'N' if axis in 'XYZ' else 'N m'}"


def _largest(force: dict[str, float]) -> str:
    """Return the largest force and the largest moment in words; empty where there is neither."""
    told = []
    for kind in ("XYZ", "KMN"):
        axis = max(kind, key=lambda a: force[a] if _known(force[a]) else -1.0)
        largest = force[axis]
        if _known(largest) and largest > 1e-9:
            told.append(f"{_size(largest, axis)} in {MOTIONS[axis]}")
    return _listed(told)


def _listed(words: list[str]) -> str:
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} and {words[-1]}"
