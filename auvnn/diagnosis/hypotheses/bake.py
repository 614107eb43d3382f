"""Put fitted coefficients into the vehicle's own numbers, and fitted effects into the model's list."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from auvnn.diagnosis.hypotheses.fit import FittedHypothesis
from auvnn.diagnosis.hypotheses.layout import Layout
from auvnn.effects.base import Body
from auvnn.estimation.priors import set_parameters
from auvnn.models import GreyBox
from auvnn.vehicle import Vehicle


def with_fitted_parameters(model: GreyBox, layout: Layout, found: FittedHypothesis) -> GreyBox:
    """Return the model with an explanation in it.

    Coefficients that were merely refitted become the vehicle's numbers; effects that were asked for, and
    those that the model had, stay effects, so that they can be seen and removed.
    """
    full = layout.model.rebuilt(layout.model.copied_effects())
    set_parameters(full, found.names, found.fitted.theta)
    coefficients = [n for n in layout.nuisance if n not in found.effects and n not in model.effect_names]
    keep = [*model.effect_names, *(n for n in found.effects if n not in model.effect_names)]
    body = GreyBox(model.vehicle, actuation=model.actuation).prepare().body
    for name in coefficients:
        body = full.effect(name).body(body, None)
    copies = {str(e.name): e for e in full.copied_effects()}
    return model.rebuilt([copies[n] for n in keep], with_body(model.vehicle, body))


def with_body(vehicle: Vehicle, body: Body) -> Vehicle:
    """Return the vehicle with the numbers of a body."""

    def array(x: object) -> np.ndarray | None:
        return None if x is None else x.detach().numpy().copy()  # type: ignore[attr-defined]

    elements = vehicle.damping_elements
    linear, quadratic = array(body.element_linear), array(body.element_quadratic)
    if linear is not None and quadratic is not None:
        elements = tuple(replace(e, linear=linear[k], quadratic=quadratic[k]) for k, e in enumerate(elements))
    return replace(
        vehicle,
        inertia=array(body.inertia),
        added_mass=array(body.added_mass),
        linear_damping=array(body.linear),
        quadratic_damping=array(body.quadratic),
        damping_elements=elements,
    )
