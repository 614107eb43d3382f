"""With what a name is confounded: which other parameters could do the same on this log, and how far they would move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.answers.words import number
from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout, shapes

Array = NDArray[np.float64]
# Share of a name's trace that other parameters must be able to imitate to be reported; parameters that are reported; and
# the least share of the largest movement, in plausible sizes, that is worth a word.
IMITATED, TOLD, LEAST = 0.8, 4, 0.2
# Gains of all thrusters within so many hundredths of one another are one gain.
EVEN = 0.15
EQUATION = ("thruster_gain",)


def confounded_with(layout: Layout, found: FittedHypothesis, name: str) -> list[str]:
    """Return in words what else could do on this log what a name does.

    What the name's fitted departure from its null does is imitated by all other parameters, what was stated of them set
    aside: x = H_oo^-1 H_on d. Where that takes most of its trace, the parameters that would move most are reported.

    Args:
        layout: stated values.
        found: the fit.
        name: one of its effects.
    """
    out = _of_scale(layout, found, name)
    places = layout.places(found.names)
    own = places[name]
    departure = np.where(shapes(layout, name), 0.0, found.fitted.theta[own] - layout.means[name])
    others = np.setdiff1d(np.arange(len(found.fitted.theta)), own)
    if not others.size or not departure.any():
        return out
    total = found.fitted.statistics.total
    unit = np.concatenate([_sizes(layout, n) for n in found.names])
    inner = total[np.ix_(others, others)] * unit[others][:, None] * unit[others]
    across = total[np.ix_(others, own)] @ departure * unit[others]
    step = np.linalg.lstsq(inner + 1e-9 * np.eye(len(others)), across, rcond=1e-10)[0]
    whole = float(departure @ total[np.ix_(own, own)] @ departure)
    share = float(step @ across) / whole if whole > 0 else 0.0
    if share < IMITATED:
        return out
    moves: list[tuple[float, str]] = []
    for other in found.names:
        if other == name:
            continue
        at = np.searchsorted(others, places[other])
        for k, p in zip(at, layout.described(other), strict=True):
            now = float(found.fitted.theta[others[k]])
            then, now_words = now + float(step[k] * unit[others[k]]), number(now, None, p.unit)
            words = f"{other}.{p.name} {number(then, None, p.unit)} instead of {now_words}"
            moves.append((abs(float(step[k])), words))
    moves.sort(reverse=True)
    told = [words for size, words in moves[:TOLD] if size >= LEAST * moves[0][0]]
    if told:
        out.append(f"{min(share, 1.0):.0%} of what it does here, {', '.join(told)} would do as well")
    return out


def _of_scale(layout: Layout, found: FittedHypothesis, name: str) -> list[str]:
    """Say of one gain on all thrusters that it cannot be told from the scale of everything else.

    M nu_dot + C nu + D nu + g = k B f is M/k nu_dot + C/k nu + D/k nu + g/k = B f.
    """
    if name not in EQUATION:
        return []
    gains = found.fitted.theta[layout.places(found.names)[name]]
    gain = float(np.median(gains))
    if gain <= 0.0 or np.abs(gains / gain - 1.0).max() > EVEN or abs(gain - 1.0) < 0.1:
        return []
    return [
        f"a gain of {gain:.2g} on all thrusters is the same as mass, added mass, damping and restoring forces times "
        f"{1.0 / gain:.2g}"
    ]


def _sizes(layout: Layout, name: str) -> Array:
    """Return how far each parameter of an effect may plausibly move, (p,)."""
    stated = layout.spreads.get(name)
    return np.array([p.scale for p in layout.described(name)]) if stated is None else np.asarray(stated)
