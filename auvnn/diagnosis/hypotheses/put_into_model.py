"""Put fitted coefficients into the vehicle's own numbers, and fitted effects into the model's list."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.standard_errors import standard_errors
from auvnn.diagnosis.hypotheses.stated_priors import GROUPS, Layout
from auvnn.effects import EFFECTS, Effect
from auvnn.effects.hooks import Body
from auvnn.estimation.priors import set_parameters
from auvnn.models import GreyBox
from auvnn.models.joint_covariance import JointCovariance
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]


def with_fitted_parameters(model: GreyBox, layout: Layout, found: FittedHypothesis) -> GreyBox:
    """Return the model with an explanation in it.

    Coefficients that were merely refitted become the vehicle's numbers; effects that were asked for, and
    those that the model had, stay effects, so that they can be seen and removed, with their standard errors as their
    uncertainty, and how they go together as the model's joint covariance. A mass, a centre or a thrust that was stated
    to be uncertain becomes an effect too.

    Args:
        model: as it was given.
        layout: which columns of the fit belong to which effect.
        found: the explanation.
    """
    return holding(model, layout, found.names, found.fitted.theta, found.effects, found)


def holding(
    model: GreyBox,
    layout: Layout,
    names: Sequence[str],
    theta: Array,
    effects: Sequence[str],
    fit: FittedHypothesis | None = None,
) -> GreyBox:
    """Return the model with fitted values in it; see `with_fitted_parameters`.

    Args:
        model: as known.
        layout: of the fit.
        names: effects that were free, in order of their columns.
        theta: (P,) their values.
        effects: those that were asked for.
        fit: from which the effects' standard errors are taken, where they are wanted.
    """
    full = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(full, names, theta)
    refitted = [n for n in layout.nuisance if n not in effects and n not in model.effect_names]
    coefficients = [n for n in refitted if n in GROUPS or n not in EFFECTS]
    others = [n for n in refitted if n not in coefficients and n in names]
    keep = [*model.effect_names, *(n for n in effects if n not in model.effect_names), *others]
    body = GreyBox(model.vehicle, actuation=model.actuation).prepare().body
    for name in coefficients:
        body = full.effect(name).body(body, None)
    copies = {str(e.name): e for e in full.copied_effects()}
    for name, at in layout.places(names).items() if fit is not None else ():
        if fit is not None and name in keep and name in EFFECTS:
            errors, _ = standard_errors(fit, at)
            known = zip(copies[name].parameters_of, errors, strict=True)
            copies[name].uncertainty = {p.name: float(std) for p, std in known if np.isfinite(std)}
    made = model.rebuilt([copies[n] for n in keep], with_body(model.vehicle, body))
    if fit is not None:
        made.joint = _joint(layout, names, fit, copies, [n for n in keep if n in names and n in EFFECTS])
    return made


def _joint(
    layout: Layout,
    names: Sequence[str],
    fit: FittedHypothesis,
    copies: Mapping[str, Effect],
    keep: Sequence[str],
) -> JointCovariance | None:
    """Return how the effects' parameters go together: the fit's correlations, at their standard errors.

    What the log does not determine has no standard error and is left out; so are coefficients that became the vehicle's
    numbers, over which the covariance is the marginal one.
    """
    covariance = (fit.under_law or fit.fitted).covariance()
    labels: list[str] = []
    columns: list[int] = []
    std: list[float] = []
    for name, at in layout.places(names).items():
        if name in keep:
            for parameter, column in zip(copies[name].parameters_of, at, strict=True):
                error = copies[name].uncertainty.get(parameter.name, 0.0)
                if error > 0.0 and covariance[column, column] > 0.0:
                    labels.append(f"{name}.{parameter.name}")
                    columns.append(int(column))
                    std.append(error)
    if len(labels) < 2:
        return None
    part = covariance[np.ix_(columns, columns)]
    unit = np.array(std) / np.sqrt(np.diag(part))
    matrix = part * unit[:, None] * unit
    return JointCovariance(tuple(labels), 0.5 * (matrix + matrix.T))


def with_body(vehicle: Vehicle, body: Body) -> Vehicle:
    """Return the vehicle with the numbers of a body."""

    def array(x: object) -> np.ndarray | None:
        return None if x is None else x.detach().numpy().copy()  # type: ignore[attr-defined]

    elements = vehicle.damping_elements
    linear, quadratic = array(body.element_linear), array(body.element_quadratic)
    if linear is not None and quadratic is not None:
        elements = tuple(replace(e, linear=linear[k], quadratic=quadratic[k]) for k, e in enumerate(elements))
    inertia, added_mass = array(body.inertia), array(body.added_mass)
    if inertia is not None and added_mass is not None:
        inertia, added_mass = of_a_body(inertia, added_mass)
    return replace(
        vehicle,
        inertia=inertia,
        added_mass=added_mass,
        linear_damping=array(body.linear),
        quadratic_damping=array(body.quadratic),
        damping_elements=elements,
    )


def of_a_body(inertia: Array, added_mass: Array) -> tuple[Array, Array]:
    """Return an inertia that a body can have, and the added mass that takes over what is more.

    Only the sum of I_b and of the rotational block of M_A is in M and in C (Fossen, 2011, sections 3.3 and 6.3), so
    that a fit to a slender body, I_x + I_y near I_z, may ask of the inertia alone what no body has: a principal moment
    beyond the sum of the others. What is beyond goes into the added mass, and every force stays what it was.

    Args:
        inertia: I_g, (3, 3), kg m2.
        added_mass: M_A, (6, 6).
    """
    moments, axes = np.linalg.eigh(inertia)
    beyond = moments[2] - (moments[0] + moments[1])
    if beyond <= 0.0:
        return inertia, added_mass
    part = beyond * np.outer(axes[:, 2], axes[:, 2])
    added = added_mass.copy()
    added[3:, 3:] += part
    return inertia - part, added
