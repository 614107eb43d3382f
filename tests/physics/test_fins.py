"""Fins: signs of a published vehicle, lift by hand, geometry, stall, and no speed at all."""

import math

import numpy as np
import pytest
import torch
from scipy.optimize import least_squares

from auvnn.physics.fins import fin_force, fin_frame, fin_wrench, lift_coefficient

# REMUS 100 (Prestero 2001): one rudder (axis z) and one stern plane (axis y).
AREA, SLOPE, STALL, DENSITY, X_FIN = 0.00665, 3.12, 0.26, 1030.0, -0.683


def tensor(values):
    return torch.tensor(values, dtype=torch.float64)


def fins(nu, angles, position=((X_FIN, 0, 0), (X_FIN, 0, 0)), axis=((0, 0, 1), (0, 1, 0)), stall=STALL):
    n = len(position)
    numbers = (tensor([x] * n) for x in (AREA, SLOPE, stall))
    return fin_force(
        tensor(nu), tensor(angles), tensor(position).double(), tensor(axis).double(), *numbers, DENSITY
    )


def test_signs_and_size_of_the_remus_derivatives():
    """Y_uudr > 0, N_uudr < 0, Z_uuds < 0, M_uuds < 0, each 1/2 rho S c_La, moments x_fin times the force."""
    u, delta = 1.54, 0.01
    derivative = 0.5 * DENSITY * AREA * SLOPE
    rudder, stern = fins([u, 0, 0, 0, 0, 0], [delta, 0.0]), fins([u, 0, 0, 0, 0, 0], [0.0, delta])
    scale = u * u * delta
    expected = derivative * tensor([0, 1, 0, 0, 0, X_FIN])
    torch.testing.assert_close(rudder / scale, expected, rtol=1e-4, atol=1e-12)
    expected = derivative * tensor([0, 0, -1, 0, X_FIN, 0])
    torch.testing.assert_close(stern / scale, expected, rtol=1e-4, atol=1e-12)


def test_effective_angle_holds_the_local_flow():
    """delta_e = delta_r - (v + x r)/u and delta_s + (w - x q)/u (Prestero 2001)."""
    u, v, w, q, r, dr, ds = 1.5, 0.03, -0.02, 0.02, -0.04, 0.05, -0.03
    wrench = fins([u, v, w, 0.3, q, r], [dr, ds])
    side, down = v + X_FIN * r, w - X_FIN * q
    rudder = 0.5 * DENSITY * AREA * SLOPE * (u * u + side * side) * (dr - math.atan2(side, u))
    stern = 0.5 * DENSITY * AREA * SLOPE * (u * u + down * down) * (ds + math.atan2(down, u))
    beta, gamma = math.atan2(side, u), math.atan2(down, u)
    y, z = rudder * math.cos(beta), -stern * math.cos(gamma)
    x = -rudder * math.sin(beta) + stern * math.sin(gamma)
    np.testing.assert_allclose(wrench.numpy(), [x, y, z, 0.0, -X_FIN * z, X_FIN * y], rtol=3e-4, atol=1e-12)


def test_a_fin_that_points_along_its_motion_gives_no_force():
    assert fins([1.5, 1.5 * math.tan(0.1), 0, 0, 0, 0], [0.1, 0.0]).abs().max() < 1e-12


def test_lift_is_perpendicular_to_flow_and_axis_for_any_fin(draw):
    position, axis, nu, angle = draw(4, 3), draw(4, 3), draw(30, 6), 0.5 * draw(30, 4)
    axis = axis / axis.norm(dim=-1, keepdim=True)
    numbers = tensor([0.01]), tensor([3.0]), tensor([0.3])
    for i in range(4):
        wrench = fin_force(nu, angle[:, i : i + 1], position[i : i + 1], axis[i : i + 1], *numbers, DENSITY)
        force = wrench[:, :3].numpy()
        flow = nu[:, :3].numpy() + np.cross(nu[:, 3:].numpy(), position[i].numpy())
        assert np.linalg.norm(force, axis=1).min() > 1e-4
        assert np.abs((force * flow).sum(1)).max() < 1e-12
        assert np.abs(force @ axis[i].numpy()).max() < 1e-12
        np.testing.assert_allclose(wrench[:, 3:].numpy(), np.cross(position[i].numpy(), force), atol=1e-12)
        assert (nu * wrench).sum(-1).abs().max() < 1e-12


def test_fins_add_up(draw):
    position, axis, nu, angle = draw(4, 3), draw(4, 3), draw(5, 6), 0.3 * draw(5, 4)
    axis = axis / axis.norm(dim=-1, keepdim=True)
    area, slope, stall = draw(4).abs(), draw(4).abs(), draw(4).abs() + 0.1
    single = [
        fin_force(nu, angle[:, i:j], position[i:j], axis[i:j], area[i:j], slope[i:j], stall[i:j], DENSITY)
        for i, j in ((0, 1), (1, 2), (2, 3), (3, 4))
    ]
    together = fin_force(nu, angle, position, axis, area, slope, stall, DENSITY)
    torch.testing.assert_close(together, torch.stack(single).sum(0))
    prepared = fin_wrench(nu, angle, fin_frame(position, axis), area, slope, stall, DENSITY)
    torch.testing.assert_close(prepared, together)


def test_a_fin_across_the_flow_is_turned_about_its_own_axis():
    """An X-tail fin: axis at 45 degrees; a positive angle pushes towards axis x forward."""
    half = math.sqrt(0.5)
    force = fins([2.0, 0, 0, 0, 0, 0], [0.1], position=((X_FIN, 0.1, 0.1),), axis=((0, half, half),))[:3]
    direction = np.cross([0, half, half], [1, 0, 0])
    np.testing.assert_allclose((force / force.norm()).numpy(), direction, atol=1e-12)


def test_going_astern_turns_the_force_over():
    ahead, astern = (fins([u, 0, 0, 0, 0, 0], [0.1, -0.05]) for u in (1.5, -1.5))
    torch.testing.assert_close(astern, -ahead)


@pytest.mark.parametrize("stall", [0.1, 0.26, 0.5])
def test_stall_is_smooth_and_bounded(stall):
    angle = torch.linspace(-math.pi / 2, math.pi / 2, 20001, dtype=torch.float64)
    lift = lift_coefficient(angle, tensor(SLOPE), tensor(stall))
    torch.testing.assert_close(lift, -lift.flip(0))
    small = angle.abs() < 0.1 * stall
    torch.testing.assert_close(lift[small], SLOPE * angle[small], rtol=1e-4, atol=0)
    attached = lift[(angle > 0) & (angle < 1.2 * stall)]
    assert 0.7 * SLOPE * stall < attached.max() < SLOPE * stall
    peak = angle[(angle > 0) & (angle < 1.2 * stall)][attached.argmax()]
    assert 0.7 * stall < peak < stall
    slope = lift.diff() / angle.diff()
    assert slope.diff().abs().max() < 100.0 * (angle[1] - angle[0]) * SLOPE / stall
    plate = 2.0 * torch.sin(angle) * torch.sin(angle).abs() * torch.cos(angle)
    far = angle.abs() > 2.0 * stall
    torch.testing.assert_close(lift[far], plate[far], rtol=0, atol=1e-4)
    assert lift[[0, -1]].abs().max() < 1e-9


@pytest.mark.parametrize("sharpness", [1.5, 3.0, 30.0])
@pytest.mark.parametrize("separated", [0.0, 0.59, 1.0])
def test_another_stall(sharpness, separated):
    """Whatever the stall: c_La is the slope at no angle, half of the lift is attached at alpha_0, a plate's is beyond."""

    def lift(angle):
        numbers = map(tensor, (angle, SLOPE, STALL, sharpness, separated))
        return float(lift_coefficient(*numbers))

    assert lift(1e-7) / 1e-7 == pytest.approx(SLOPE, rel=1e-5)
    attached = 0.5 * (1.0 + math.exp(-sharpness))
    plate = separated * 2.0 * math.sin(STALL) ** 2 * math.cos(STALL)
    assert lift(STALL) == pytest.approx(attached * SLOPE * STALL + (1.0 - attached) * plate)
    if sharpness == 30.0:
        # The plate has the normal force c_s 2 sin(alpha)^2, of which the lift is the part across the flow.
        across = separated * 2.0 * math.sin(1.2) ** 2
        assert lift(1.2) == pytest.approx(across * math.cos(1.2), abs=1e-9)
    left = SLOPE * math.pi * math.exp(sharpness * (1.0 - math.pi / 2 / STALL))
    assert lift(math.pi / 2) == pytest.approx(0.0, abs=left + 1e-12)


def test_a_gentle_stall_is_within_reach():
    """Of c_La a cos(a) / sqrt(1 + (a / a_0)^4), the independent plant's gentle stall, a twentieth of the peak is left."""
    angle = np.linspace(0.0, math.pi / 2, 400)
    gentle = SLOPE * angle * np.cos(angle) / np.sqrt(1.0 + (angle / STALL) ** 4)

    def off(p):
        numbers = map(tensor, (angle.tolist(), SLOPE, STALL * p[0], 12.0 * p[1], p[2]))
        return lift_coefficient(*numbers).numpy() - gentle

    left = least_squares(off, (1.0, 1.0, 1.0), bounds=([0.2, 0.1, 0.0], [4.0, 4.0, 3.0])).fun
    assert np.sqrt(np.mean(left**2)) < 0.05 * gentle.max()
    assert np.sqrt(np.mean(off((1.0, 1.0, 1.0)) ** 2)) > 0.7 * gentle.max()


@pytest.mark.parametrize("angle", [0.03, 0.1, -0.1])
def test_the_tips_add_a_square_of_the_angle_to_the_attached_lift(angle):
    """Whicker and Fehlner (1958): C_L = c_La alpha + C_Dc / a alpha^2 where nothing is separated."""
    numbers = (angle, SLOPE, STALL, 40.0, 1.0, 0.5)
    expected = SLOPE * angle + math.copysign(0.5 * angle**2, angle)
    assert float(lift_coefficient(*map(tensor, numbers))) == pytest.approx(expected, rel=1e-6)
    assert expected != pytest.approx(SLOPE * angle, rel=1e-3)


def test_force_passes_through_cross_flow_without_a_jump():
    """The angle of attack wraps at +-pi/2, where the lift is zero."""
    near = [fins([0.0, 0.0, 0.0, 0, 0, 0], [0.0, 0.0])]
    near += [fins([s * 1e-9, 1.0, 0, 0, 0, 0], [0.0, 0.0]) for s in (-1, 1)]
    assert torch.stack(near).abs().max() < 1e-6


@pytest.mark.parametrize("jacobian", [torch.func.jacfwd, torch.func.jacrev])
def test_no_speed_no_force_and_no_slope(jacobian):
    geometry = tensor([[X_FIN, 0, 0], [X_FIN, 0, 0]]), tensor([[0, 0, 1.0], [0, 1, 0]])
    numbers = tensor([AREA] * 2), tensor([SLOPE] * 2), tensor([STALL] * 2)

    def force(nu, angle):
        return fin_force(nu, angle, *geometry, *numbers, DENSITY)

    rest, angle = torch.zeros(6).double(), tensor([0.1, 0.2])
    assert (force(rest, angle) == 0.0).all()
    for argument in (0, 1):
        assert (jacobian(force, argnums=argument)(rest, angle) == 0.0).all()
