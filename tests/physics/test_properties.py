"""What every public function of the physics promises: gradients, batches, types, shapes, no hidden branch.

A new function in auvnn.physics must be given a case here: test_every_function_has_a_case fails otherwise.
"""

import importlib
import inspect
import pkgutil

import jaxtyping
import pytest
import torch
from beartype import beartype
from jaxtyping import jaxtyped

import auvnn.physics
from auvnn.physics import attitude as at
from auvnn.physics import (
    coriolis,
    current,
    drag,
    energy,
    fins,
    frames,
    inertia,
    kinematics,
    recurrence,
    restoring,
    thrusters,
)
from auvnn.physics.products import Bilinear, ProductTable, cross, matvec


def vector(*shape):
    return lambda draw: draw(*shape)


def positive(*shape):
    return lambda draw: draw(*shape).abs() + 0.3


def small(*shape):
    return lambda draw: 0.4 * torch.tanh(draw(*shape))


def rising(*shape):
    return lambda draw: (draw(*shape).abs() + 0.2).cumsum(-1) - 2.0


def unit(*shape):
    def make(draw):
        x = draw(*shape)
        return x / x.norm(dim=-1, keepdim=True)

    return make


def quaternion(draw):
    return draw.quaternion()


def definite(size):
    return lambda draw: draw.definite(size)


def rotation(draw):
    return at.quat_to_matrix(draw.quaternion())


def pose(draw):
    return torch.cat((draw(3), draw.quaternion()))


V3, V6, R, I3, M6, Q = vector(3), vector(6), rotation, definite(3), definite(6), quaternion
FINS = (positive(2), positive(2), positive(2), positive())

# function: one maker per argument
CASES = {
    at.skew: (V3,),
    at.quat_normalize: (vector(4),),
    at.quat_multiply: (Q, Q),
    at.quat_conjugate: (Q,),
    at.quat_to_matrix: (Q,),
    at.quat_rotate: (Q, V3),
    at.quat_rotate_inverse: (Q, V3),
    at.quat_derivative: (Q, V3),
    at.euler_to_quat: (V3,),
    at.quat_to_euler: (Q,),
    at.rotvec_to_quat: (V3,),
    at.quat_to_rotvec: (Q,),
    at.matrix_to_quat: (R,),
    kinematics.eta_derivative: (pose, V6),
    kinematics.eta6_to_eta7: (V6,),
    kinematics.eta7_to_eta6: (pose,),
    inertia.screw: (V3,),
    inertia.translate_inertia: (M6, V3),
    inertia.rigid_body_inertia: (positive(), I3, V3),
    inertia.is_positive_definite: (M6,),
    coriolis.coriolis_matrix: (M6, V6),
    coriolis.coriolis_force: (M6, V6),
    restoring.restoring_gain: (positive(), positive(), V3, V3),
    restoring.restoring_force: (R, positive(), positive(), V3, V3),
    drag.damping_force: (V6, M6, M6),
    drag.element_transform: (V3, R),
    drag.element_force: (V6, V3, R, positive(6), positive(6)),
    current.water_velocity: (R, V3, V3, V3),
    thrusters.allocation_matrix: (vector(4, 3), unit(4, 3)),
    thrusters.quadratic_thrust: (vector(4), positive(4), positive(4)),
    thrusters.table_thrust: (vector(4), rising(4, 5), rising(4, 5)),
    thrusters.summed_table_thrust: (vector(4), rising(4, 5), rising(4, 5)),
    fins.fin_frame: (vector(2, 3), unit(2, 3)),
    fins.fin_wrench: (V6, small(2), vector(2, 2, 6), *FINS),
    fins.fin_force: (V6, small(2), vector(2, 3), unit(2, 3), *FINS),
    fins.lift_coefficient: (small(2), positive(2), positive(2)),
    frames.flu_frd_vector: (V3,),
    frames.flu_frd_velocity: (V6,),
    frames.flu_frd_matrix: (vector(6, 6),),
    frames.flu_frd_quaternion: (Q,),
    frames.enu_ned_vector: (V3,),
    frames.enu_ned_quaternion: (Q,),
    frames.enu_flu_quaternion: (Q,),
    energy.kinetic_energy: (M6, V6),
    energy.potential_energy: (V3, R, positive(), positive(), V3, V3),
    recurrence.first_order_recurrence: (small(5, 3), vector(5, 3)),
    recurrence.closing_gap: (vector(5, 3), small(4, 3)),
    matvec: (vector(4, 3), V3),
    cross: (V3, V3),
}
# A table may serve all thrusters, so their number is not tied to its shape; lift is element by element.
UNTIED = {
    (thrusters.table_thrust, 0),
    (thrusters.summed_table_thrust, 0),
    *((fins.lift_coefficient, i) for i in range(3)),
}
NOT_SMOOTH = {inertia.is_positive_definite}

every = pytest.mark.parametrize("function", CASES, ids=lambda f: f.__name__)
smooth = pytest.mark.parametrize(
    "function", [f for f in CASES if f not in NOT_SMOOTH], ids=lambda f: f.__name__
)


def samples(function, draw, count):
    """Return ``count`` sets of arguments for single samples."""
    return [tuple(make(draw) for make in CASES[function]) for _ in range(count)]


def stacked(sets):
    return tuple(torch.stack(column) for column in zip(*sets, strict=True))


def answers(result):
    return result if isinstance(result, tuple) else (result,)


def close(a, b, **tolerance):
    torch.testing.assert_close(answers(a), answers(b), **(tolerance or {"atol": 1e-13, "rtol": 1e-12}))


def test_every_function_has_a_case():
    public = set()
    names = {found.name for found in pkgutil.iter_modules(auvnn.physics.__path__)}
    for name in names - {"products"}:
        module = importlib.import_module(f"auvnn.physics.{name}")
        for own, value in inspect.getmembers(module, inspect.isfunction):
            if value.__module__ == module.__name__ and not own.startswith("_"):
                public.add(value)
    assert public == set(CASES) - {matvec, cross}


@smooth
def test_gradients_backward_and_forward(function, draw):
    arguments = [x.requires_grad_() for x in samples(function, draw, 1)[0]]
    assert torch.autograd.gradcheck(function, arguments, check_forward_ad=True, atol=1e-6, rtol=1e-5)


@every
def test_batch_equals_loop(function, draw):
    sets = samples(function, draw, 6)
    looped = stacked([answers(function(*one)) for one in sets])
    close(function(*stacked(sets)), looped)
    deep = [x.unflatten(0, (2, 3)) for x in stacked(sets)]
    close(function(*deep), tuple(x.unflatten(0, (2, 3)) for x in looped))


@every
def test_one_batched_argument_broadcasts_against_single_others(function, draw):
    """Leading shapes broadcast also when their numbers differ, eagerly and under vmap."""
    sets = samples(function, draw, 3)
    for i in range(len(CASES[function])):
        column = torch.stack([one[i] for one in sets])
        mixed = [column if j == i else x for j, x in enumerate(sets[0])]
        full = [column if j == i else torch.stack([x] * 3) for j, x in enumerate(sets[0])]
        expected = function(*full)
        got = tuple(g.expand_as(e) for g, e in zip(answers(function(*mixed)), answers(expected), strict=True))
        close(got, answers(expected))
        lanes = tuple(0 if j == i else None for j in range(len(mixed)))
        close(torch.func.vmap(function, in_dims=lanes)(*mixed), expected)


@smooth
def test_jvp_and_vjp_inside_vmap_agree(function, draw):
    """The way in which all step Jacobians of a rollout are taken at once."""
    points, directions = (stacked(samples(function, draw, 4)) for _ in range(2))

    def push(point, direction):
        return answers(torch.func.jvp(function, point, direction)[1])

    def pull(point, weights):
        return torch.func.vjp(lambda *x: answers(function(*x)), *point)[1](weights)

    pushed = torch.func.vmap(push)(points, directions)
    weights = tuple(draw(*rate.shape) for rate in pushed)
    pulled = torch.func.vmap(pull)(points, weights)
    forward = sum((w * rate).reshape(4, -1).sum(1) for w, rate in zip(weights, pushed, strict=True))
    backward = sum((d * g).reshape(4, -1).sum(1) for d, g in zip(directions, pulled, strict=True))
    torch.testing.assert_close(forward, backward, atol=1e-10, rtol=1e-9)


@every
def test_float32_stays_float32_and_agrees(function, draw):
    arguments = stacked(samples(function, draw, 5))
    wide = answers(function(*arguments))
    narrow = answers(function(*(x.float() for x in arguments)))
    for a, b in zip(narrow, wide, strict=True):
        assert b.dtype in (torch.float64, torch.bool)
        assert a.dtype == (torch.bool if b.dtype == torch.bool else torch.float32)
        torch.testing.assert_close(a, b, check_dtype=False, atol=3e-4, rtol=1e-3)


@smooth
def test_device_follows_the_inputs(function, draw):
    """The meta device stands for any other: a constant left on the CPU would be refused."""
    arguments = [x.to("meta") for x in stacked(samples(function, draw, 2))]
    assert {x.device.type for x in answers(function(*arguments))} == {"meta"}


@every
def test_shapes_in_the_signature_hold(function, draw):
    checked = jaxtyped(function, typechecker=beartype)
    sets = samples(function, draw, 3)
    checked(*sets[0])
    checked(*stacked(sets))
    if function in (matvec, cross):
        return
    for i, x in enumerate(sets[0]):
        if x.dim() > 0 and (function, i) not in UNTIED:
            with pytest.raises(jaxtyping.TypeCheckError):
                checked(*(y[..., :-1] if i == j else y for j, y in enumerate(sets[0])))


@smooth
def test_nothing_is_written_into_the_inputs(function, draw):
    arguments = samples(function, draw, 1)[0]
    before = [x.clone() for x in arguments]
    for result in answers(function(*arguments)):
        result.add_(1.0)
    # A view of an input would have carried the addition back.
    assert all(torch.equal(a, b) for a, b in zip(arguments, before, strict=True))


@smooth
def test_gradients_are_finite_when_everything_moving_is_at_rest(function, draw):
    """Zero velocity, rate, command and angle; geometry, attitude and parameters stay as they are."""
    still = {
        at.rotvec_to_quat: (0,),
        at.quat_rotate: (1,),
        at.quat_derivative: (1,),
        at.euler_to_quat: (0,),
        kinematics.eta_derivative: (1,),
        coriolis.coriolis_matrix: (1,),
        coriolis.coriolis_force: (1,),
        drag.damping_force: (0,),
        drag.element_force: (0, 1),
        current.water_velocity: (1, 2, 3),
        thrusters.quadratic_thrust: (0,),
        thrusters.table_thrust: (0,),
        fins.fin_force: (0, 1),
        fins.fin_wrench: (0, 1),
        fins.lift_coefficient: (0,),
    }
    arguments = list(samples(function, draw, 1)[0])
    for i in still.get(function, ()):
        arguments[i] = torch.zeros_like(arguments[i])
    if function is at.quat_to_rotvec:
        arguments = [torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64)]
    for jacobian in (torch.func.jacfwd, torch.func.jacrev):
        for leaf in torch.utils._pytree.tree_leaves(
            jacobian(function, tuple(range(len(arguments))))(*arguments)
        ):
            assert torch.isfinite(leaf).all()


def test_tables_made_in_inference_mode_serve_gradients_later():
    with torch.inference_mode():
        product = Bilinear(2, 2, 1, [(0, 1, 0, 3.0)])
        product(torch.ones(2), torch.ones(2))
    a = torch.ones(2, requires_grad=True)
    product(a, torch.ones(2)).sum().backward()
    assert a.grad is not None
    assert a.grad.tolist() == [3.0, 0.0]


def test_tables_follow_other_types():
    assert ProductTable([[1, 2]]).like(torch.ones(1, dtype=torch.float16)).dtype == torch.float16
