"""Whether a fit stopped for a reason other than the data: at a bound, or before it had settled."""

from __future__ import annotations

from collections.abc import Sequence

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.stated_priors import Layout


def at_bound(layout: Layout, found: FittedHypothesis, name: str) -> list[str]:
    """Return which parameters of an effect ended at a bound that is not their null.

    Args:
        layout: stated values.
        found: the fit.
        name: one of its effects.
    """
    out = []
    values = found.fitted.theta[layout.places(found.names)[name]]
    for value, p in zip(values, layout.described(name), strict=True):
        near = 1e-6 * max(abs(p.low), abs(p.high), abs(p.scale)) if abs(p.high - p.low) < 1e6 else 1e-9
        if (value <= p.low + near or value >= p.high - near) and abs(value - p.null) > near:
            out.append(p.name)
    return out


def reservations(layout: Layout, found: FittedHypothesis, names: Sequence[str]) -> list[str]:
    """Return warnings where a fit must not be accepted silently.

    Args:
        layout: stated values and bounds.
        found: the fit.
        names: effects whose parameters are looked at.
    """
    out = []
    if not found.fitted.converged:
        out.append("the fit had not settled when it was stopped: read the parameters with care")
    for name in names:
        for parameter in at_bound(layout, found, name):
            at = list(p.name for p in layout.described(name)).index(parameter)
            value = found.fitted.theta[layout.places(found.names)[name]][at]
            unit = layout.described(name)[at].unit
            shown = "" if unit == "1" else f" {unit}"
            out.append(f"{name}.{parameter} ended at its bound {value:g}{shown}: the data ask for more")
    return out
