"""Stated coefficients that a fit has moved further than what was stated of them allows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from auvnn.answer_types import MovedCoefficient
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout

# Stated standard deviations from which on a movement is told, and coefficients that the words name.
FAR, NAMED = 2.0, 6


def moved(layout: Layout, found: FittedHypothesis) -> list[MovedCoefficient]:
    """Return stated coefficients that moved by more than two of their standard deviations, the furthest first.

    Args:
        layout: stated values.
        found: the fit.
    """
    return moved_beyond(layout, found, FAR)


def moved_beyond(layout: Layout, found: FittedHypothesis, least: float) -> list[MovedCoefficient]:
    """Return stated coefficients that moved by more than so many of their standard deviations, the furthest first.

    Each is a factor on what the vehicle's file states, which is one; `deviations` says by how many of the stated standard
    deviations it has left that. Groups that were asked for as effects are reported as effects.

    Args:
        layout: stated values.
        found: the fit.
        least: stated standard deviations.
    """
    out: list[MovedCoefficient] = []
    for name, own in layout.places(found.names).items():
        spread = layout.spreads.get(name)
        if spread is None or name in found.effects or name == "learned_drag":
            continue
        for value, mean, size, p in zip(
            found.fitted.theta[own],
            layout.means[name],
            np.broadcast_to(spread, len(own)),
            layout.described(name),
            strict=True,
        ):
            away = float((value - mean) / size)
            if abs(away) > least:
                out.append(
                    {
                        "group": name,
                        "coefficient": p.name,
                        "stated": float(mean),
                        "fitted": float(value),
                        "deviations": away,
                    }
                )
    return sorted(out, key=lambda m: -abs(m["deviations"]))


def moved_words(found: list[MovedCoefficient]) -> list[str]:
    """Return that in words, one sentence or none."""
    if not found:
        return []
    return [
        "Stated coefficients moved by more than two of their standard deviations (how many in brackets): "
        f"{in_words(found)}."
    ]


def in_words(found: Sequence[MovedCoefficient]) -> str:
    """Return the coefficients that went furthest: name, what it became, and by how many stated standard deviations.

    Args:
        found: the furthest first.
    """
    more = [f"and {len(found) - NAMED} more"] if len(found) > NAMED else []
    return ", ".join([*(_one(m) for m in found[:NAMED]), *more])


def _one(one: MovedCoefficient) -> str:
    name = f"{one['group']}.{one['coefficient']}"
    size = f"times {one['fitted'] / one['stated']:.3g}" if one["stated"] else f"{one['fitted']:.3g}"
    return f"{name} {size} ({one['deviations']:+.1f})"
