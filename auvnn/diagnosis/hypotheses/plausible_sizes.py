"""How likely the parameters of an explanation are by themselves: what was stated, and how large effects are likely to be.

What the model states has a normal prior. How large an effect that is asked for may be, the catalogue's scale, is a
guess, and a hidden effect may be twenty times as large: with a normal prior such a guess would outvote any data. Its
standard deviation s is therefore uncertain too, at least the scale and with a density that falls as s^-2 beyond. At the
likeliest s minus twice the logarithm of the prior of a parameter x scales from its null is, up to a constant,

    x^2 where |x| <= sqrt(3), else 3 + 3 log(x^2 / 3),

of which the tail is that of Student's distribution with two degrees of freedom.

Reference: O'Hagan and Pericchi (2012), Brazilian Journal of Probability and Statistics 26(4), on heavy tails that
resolve a conflict of prior and data.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.stated_priors import Layout, correlation_root, scales, shapes

Array = NDArray[np.float64]
# Square beyond which a larger standard deviation is likelier.
BEYOND = 3.0


def sizes_of(layout: Layout, names: Sequence[str], effects: Sequence[str]) -> Array:
    """Return the standard deviations of parameters as they are likely to be, (P,).

    Args:
        layout: stated values.
        names: effects whose P parameters are free, in order.
        effects: those of them that are asked for; of the others what was stated counts.
    """
    out = [np.zeros(0)]
    for name in names:
        stated = name in layout.spreads and name not in effects
        own = layout.spreads[name] if stated else scales(layout, name)
        out.append(np.broadcast_to(own, layout.means[name].shape))
    return np.concatenate(out)


def departure(layout: Layout, names: Sequence[str], effects: Sequence[str], theta: Array) -> float:
    """Return minus twice the logarithm of the prior of parameters, up to a constant.

    Args:
        layout: stated values.
        names: effects whose P parameters are free, in order.
        effects: those of them that are asked for.
        theta: their parameters, SI units, (P,).
    """
    means = np.concatenate([np.zeros(0), *(layout.means[n] for n in names)])
    away = (theta - means) / sizes_of(layout, names, effects)
    root = correlation_root(layout, names, effects)
    if root is not None:
        away = np.asarray(np.linalg.solve(root, away), dtype=np.float64)
    # Where it begins and how often it swings is as likely in one place as in another.
    away[np.concatenate([np.zeros(0, dtype=bool), *(shapes(layout, n) for n in names)])] = 0.0
    asked = [np.full(len(layout.means[n]), n in effects) for n in names]
    guessed = np.concatenate([np.zeros(0, dtype=bool), *asked])
    return float((np.where(guessed, heavy(away), away**2)).sum())


def heavy(away: Array) -> Array:
    """Return minus twice the logarithm of the prior of parameters so many scales from their nulls, up to a constant."""
    square = np.asarray(away) ** 2
    return np.where(square <= BEYOND, square, BEYOND * (1.0 + np.log(np.maximum(square, BEYOND) / BEYOND)))
