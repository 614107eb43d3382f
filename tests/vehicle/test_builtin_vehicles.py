"""The built-in vehicles against published values and computations that share nothing with the package."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from scipy.optimize import brentq

from auvnn.config import config_dir
from auvnn.physics.drag import element_force
from auvnn.physics.fins import fin_force
from auvnn.vehicle import ThrustTable, Vehicle, builtin_vehicles, load_vehicle

NAMES = ["bluerov2", "bluerov2_heavy", "remus100", "rov90", "rov95"]


def allocation(vehicle: Vehicle) -> np.ndarray:
    columns = [np.r_[t.direction, np.cross(t.position, t.direction)] for t in vehicle.thrusters]
    return np.array(columns).T


def steady_speed(force: float, linear: float, quadratic: float) -> float:
    return brentq(lambda v: linear * v + quadratic * v * abs(v) - force, 0.0, 100.0)


def element_matrix(position: np.ndarray, drag: np.ndarray) -> np.ndarray:
    """H^T diag(d) H, built column by column from the velocity of a displaced point and the moment there."""
    matrix = np.zeros((6, 6))
    for k in range(6):
        nu = np.eye(6)[k]
        there = np.r_[nu[:3] + np.cross(nu[3:], position), nu[3:]]
        force = drag * there
        matrix[:, k] = np.r_[force[:3], force[3:] + np.cross(position, force[:3])]
    return matrix


def test_all_are_there() -> None:
    assert builtin_vehicles() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_each_is_complete_and_says_where_it_comes_from(name: str) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert vehicle.warnings == ()
    assert len(vehicle.source) > 50
    assert vehicle.has_damping
    assert vehicle.n_thrusters > 0
    assert vehicle.center_of_gravity[2] > vehicle.center_of_buoyancy[2]
    assert (config_dir() / "vehicle" / f"{name}.yaml").read_text().isascii()


def test_rov90_reaches_the_known_steady_speeds() -> None:
    vehicle = load_vehicle("rov90")
    assert vehicle.linear_damping is not None
    assert vehicle.quadratic_damping is not None
    wrench = [100.0, 100.0, 100.0, 10.0, 10.0, 10.0]
    drag = zip(wrench, np.diag(vehicle.linear_damping), np.diag(vehicle.quadratic_damping), strict=True)
    speeds = [steady_speed(*row) for row in drag]
    np.testing.assert_allclose(speeds, [0.29, 0.32, 0.33, 0.23, 0.23, 0.28], atol=0.006)


def test_rov90_thrust_is_as_published() -> None:
    vehicle = load_vehicle("rov90")
    matrix = allocation(vehicle)
    assert 120 * matrix[0].sum() == pytest.approx(393, abs=0.5)
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == 5
    np.testing.assert_allclose(matrix[3], 0.0, atol=1e-12)
    assert vehicle.buoyancy - vehicle.weight == pytest.approx(0.91)
    # Equal thrust of the four horizontal ones is pure surge but for the published unequal places.
    assert np.linalg.matrix_rank(matrix[[0, 1, 5], :4]) == 3


def test_rov95_is_rov90_made_larger_at_the_same_shape() -> None:
    small, large = load_vehicle("rov90"), load_vehicle("rov95")
    s = (95 / 90) ** (1 / 3)
    element = large.damping_elements[0]
    assert small.linear_damping is not None
    assert small.quadratic_damping is not None
    pairs = [
        (large.mass, 90.0 * s**3),
        (large.length, small.length * s),
        (large.inertia, small.inertia * s**5),
        (np.diag(large.added_mass), np.diag(small.added_mass) * np.repeat([s**3, s**5], 3)),
        (element.linear, np.diag(small.linear_damping) * np.repeat([s**2, s**4], 3)),
        (element.quadratic, np.diag(small.quadratic_damping) * np.repeat([s**2, s**5], 3)),
        (large.thrusters[0].position, small.thrusters[0].position * s),
        (large.thrusters[2].position, small.thrusters[2].position * s),
    ]
    for ours, scaled in pairs:
        np.testing.assert_allclose(ours, scaled, rtol=5e-4)
    assert large.damping_elements[0].position.tolist() == [0.08, 0.02, -0.1]
    assert large.linear_damping is None
    assert large.quadratic_damping is None


def test_rov95_is_neutral_with_the_assumed_metacentre() -> None:
    vehicle = load_vehicle("rov95")
    assert vehicle.buoyancy == pytest.approx(vehicle.weight, rel=1e-12)
    assert vehicle.center_of_gravity[2] - vehicle.center_of_buoyancy[2] == pytest.approx(0.05)


def test_rov95_element_has_the_known_off_diagonals() -> None:
    # With the 90 kg vehicle's coefficients: surge-pitch -25, sway-roll 20, sway-yaw 16, heave-pitch -14.
    element = load_vehicle("rov95").damping_elements[0]
    published = load_vehicle("rov90").linear_damping
    assert published is not None
    matrix = element_matrix(element.position, np.diag(published))
    known = {(0, 4): -25, (1, 3): 20, (1, 5): 16, (2, 4): -14}
    for (i, j), value in known.items():
        assert matrix[i, j] == pytest.approx(value, abs=0.01)
        assert matrix[j, i] == matrix[i, j]
    eigenvalues = np.linalg.eigvalsh(matrix)
    assert (eigenvalues[0], eigenvalues[-1]) == pytest.approx((14.9, 252.9), abs=0.06)


def test_rov95_element_in_the_physics_is_that_matrix() -> None:
    element = load_vehicle("rov95").damping_elements[0]
    nu = torch.tensor([0.3, -0.2, 0.1, 0.2, -0.1, 0.3], dtype=torch.float64)
    arrays = (element.position, element.axes, element.linear, np.zeros(6))
    force = element_force(nu, *(torch.tensor(a) for a in arrays))
    np.testing.assert_allclose(
        force, element_matrix(element.position, element.linear) @ nu.numpy(), rtol=1e-12
    )


def test_rov95_can_make_every_wrench_of_the_paper() -> None:
    vehicle = load_vehicle("rov95")
    matrix = allocation(vehicle)
    assert np.linalg.matrix_rank(matrix) == 6
    inverse = np.linalg.pinv(matrix)
    for signs in itertools.product([-1.0, 0.0, 1.0], repeat=6):
        wrench = np.array([100.0, 100.0, 100.0, 10.0, 10.0, 10.0]) * signs
        thrust = inverse @ wrench
        np.testing.assert_allclose(matrix @ thrust, wrench, atol=1e-9)
        assert (thrust <= [t.max_forward for t in vehicle.thrusters]).all()
        assert (-thrust <= [t.max_reverse for t in vehicle.thrusters]).all()


def test_bluerov2_with_the_coefficients_of_wu() -> None:
    vehicle = load_vehicle("bluerov2")
    assert vehicle.weight == pytest.approx(112.8, abs=0.05)
    assert vehicle.linear_damping is not None
    assert vehicle.quadratic_damping is not None
    speed = steady_speed(113.0, vehicle.linear_damping[0, 0], vehicle.quadratic_damping[0, 0])
    assert speed == pytest.approx(2.4, abs=0.05)


def test_bluerov2_thrusters_are_t200_and_leave_pitch_to_surge() -> None:
    vehicle = load_vehicle("bluerov2")
    matrix = allocation(vehicle)
    assert np.linalg.matrix_rank(matrix, tol=1e-9) == 5
    # About the centre of gravity, in FRD: surge force 0.0725 m below it lifts the nose.
    about_cg = np.cross(-vehicle.center_of_gravity, matrix[:3].T)[:, 1] + matrix[4]
    np.testing.assert_allclose(about_cg[:4], 0.0725 * matrix[0, :4], atol=1e-12)
    for thruster in vehicle.thrusters:
        kgf = np.array([thruster.max_forward, thruster.max_reverse]) / 9.80665
        np.testing.assert_allclose(kgf, [5.25, 4.1], rtol=1e-4)
    assert vehicle.reference_voltage == 16.0


def eq_18(command: np.ndarray) -> np.ndarray:
    v = command
    return -140.3 * v**9 + 389.9 * v**7 - 404.1 * v**5 + 176.0 * v**3 + 8.9 * v


def test_bluerov2_heavy_reaches_its_published_top_speed() -> None:
    vehicle = load_vehicle("bluerov2_heavy")
    matrix = allocation(vehicle)
    assert np.linalg.matrix_rank(matrix) == 6
    ahead = np.sign(np.round(matrix[0], 9))
    thrust = []
    for command, thruster in zip(ahead, vehicle.thrusters, strict=True):
        assert isinstance(thruster.curve, ThrustTable)
        thrust.append(np.interp(command, thruster.curve.command, thruster.curve.thrust))
    wrench = matrix @ np.array(thrust)
    assert wrench[0] == pytest.approx(86.0, abs=0.1)
    np.testing.assert_allclose(wrench[[1, 2, 3, 5]], 0.0, atol=1e-9)
    assert vehicle.linear_damping is not None
    assert vehicle.quadratic_damping is not None
    speed = steady_speed(wrench[0], vehicle.linear_damping[0, 0], vehicle.quadratic_damping[0, 0])
    assert 0.715 <= speed <= 0.74


def test_bluerov2_heavy_curve_is_eq_18() -> None:
    commands = np.linspace(-1, 1, 2001)
    for thruster in load_vehicle("bluerov2_heavy").thrusters:
        assert isinstance(thruster.curve, ThrustTable)
        table = np.interp(commands, thruster.curve.command, thruster.curve.thrust)
        off = np.abs(table - eq_18(commands))
        # A curve that is off by more is found in a log as a dead band of the thrusters.
        assert off.max() < 0.045
        assert (
            off[np.abs(commands) >= 0.05] < 0.0035 * np.abs(eq_18(commands))[np.abs(commands) >= 0.05]
        ).all()
        assert thruster.curve.thrust[-1] == pytest.approx(30.4, abs=1e-9)
        assert thruster.max_forward == thruster.max_reverse == pytest.approx(30.62, abs=0.01)


def test_bluerov2_heavy_thrusters_stand_where_the_published_rotations_put_them() -> None:
    vehicle = load_vehicle("bluerov2_heavy")

    def turned(vector: list[float], angle: float) -> np.ndarray:
        c, s = math.cos(angle), math.sin(angle)
        return np.array([c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]])

    half = 0.5**0.5
    horizontal = zip([0, 5.05, 1.91, math.pi], [0, math.pi / 2, 3 * math.pi / 2, math.pi], strict=True)
    for (place, axis), thruster in zip(horizontal, vehicle.thrusters[:4], strict=True):
        np.testing.assert_allclose(thruster.position, turned([0.156, 0.111, 0.085], place), atol=1e-3)
        np.testing.assert_allclose(thruster.direction, turned([half, -half, 0], axis), atol=1e-12)
    vertical = {tuple(np.round(turned([0.12, 0.218, 0.0], a), 2)) for a in (0, 4.15, 1.01, math.pi)}
    assert {tuple(np.round(t.position, 2)) for t in vehicle.thrusters[4:]} == vertical
    for thruster in vehicle.thrusters[4:]:
        assert thruster.direction.tolist() == [0.0, 0.0, -1.0]


def test_bluerov2_heavy_is_one_newton_heavy() -> None:
    vehicle = load_vehicle("bluerov2_heavy")
    assert vehicle.buoyancy == pytest.approx(1000 * 9.81 * 0.0134)
    assert vehicle.weight - vehicle.buoyancy == pytest.approx(0.98, abs=0.01)


def added_mass_force(matrix: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """-C_A(nu) nu from Kirchhoff's equations: what the momentum of the water does to a moving body."""
    momentum = matrix @ nu
    force = -np.cross(nu[3:], momentum[:3])
    moment = -np.cross(nu[3:], momentum[3:]) - np.cross(nu[:3], momentum[:3])
    return np.r_[force, moment]


# Prestero's own cross terms, which he derives from the added mass; lift and fins not included.
CROSS_TERMS = {
    ("X", "wq"): -35.5, ("X", "vr"): 35.5, ("X", "qq"): -1.93, ("X", "rr"): -1.93,
    ("Y", "wp"): 35.5, ("Y", "pq"): 1.93, ("Z", "vp"): -35.5, ("Z", "rp"): 1.93,
    ("M", "uw"): 34.6, ("M", "vp"): -1.93, ("M", "rp"): 4.86,
    ("N", "uv"): -34.6, ("N", "wp"): -1.93, ("N", "pq"): -4.86,
}  # fmt: skip


@pytest.mark.parametrize(("force", "pair"), CROSS_TERMS, ids=["_".join(k) for k in CROSS_TERMS])
def test_remus_added_mass_gives_the_published_cross_terms(force: str, pair: str) -> None:
    matrix = load_vehicle("remus100").added_mass
    i, j = ("uvwpqr".index(letter) for letter in pair)
    e = np.eye(6)
    if i == j:
        found = added_mass_force(matrix, e[i])
    else:
        found = sum(added_mass_force(matrix, v) * s for v, s in ((e[i] + e[j], 1), (e[i], -1), (e[j], -1)))
    # 4.86 is published where the published derivatives give 4.81.
    assert found["XYZKMN".index(force)] == pytest.approx(CROSS_TERMS[force, pair], abs=0.055)


def test_remus_quadratic_drag_has_the_published_signs() -> None:
    vehicle = load_vehicle("remus100")
    drag = vehicle.quadratic_damping
    assert drag is not None

    def force(velocity: str) -> np.ndarray:
        nu = np.eye(6)["uvwpqr".index(velocity)]
        return -drag @ (np.abs(nu) * nu)

    published = {"u": {"X": -1.62}, "v": {"Y": -131, "N": -3.18}, "w": {"Z": -131, "M": 3.18},
                 "p": {"K": -0.13}, "q": {"Z": -0.632, "M": -9.4}, "r": {"Y": 0.632, "N": -9.4}}  # fmt: skip
    for velocity, forces in published.items():
        expected = [forces.get(name, 0.0) for name in "XYZKMN"]
        np.testing.assert_allclose(force(velocity), expected, atol=1e-12)


def test_remus_cross_flow_is_that_of_a_cylinder() -> None:
    vehicle = load_vehicle("remus100")
    assert vehicle.quadratic_damping is not None
    pressure = 0.5 * vehicle.water_density * 1.1
    assert vehicle.quadratic_damping[1, 1] == pytest.approx(pressure * 0.226, rel=0.03)
    strips = pressure * 0.191 * 2 * (1.33 / 2) ** 4 / 4
    assert vehicle.quadratic_damping[4, 4] == pytest.approx(strips, rel=0.15)


def test_remus_balances_its_propeller_at_the_published_speed() -> None:
    vehicle = load_vehicle("remus100")
    assert vehicle.quadratic_damping is not None
    speed = steady_speed(vehicle.thrusters[0].max_forward, 0.0, vehicle.quadratic_damping[0, 0])
    assert speed == pytest.approx(1.54, abs=0.01)


def test_remus_inertia_about_the_origin_is_as_published() -> None:
    rigid = load_vehicle("remus100").rigid_body
    np.testing.assert_allclose(np.diag(rigid[3:, 3:]), [0.177, 3.45, 3.45], atol=1e-5)


@pytest.mark.parametrize(("pair", "force", "moment"), [((0, 1), 1, 5), ((2, 3), 2, 4)])
def test_remus_fins_push_as_published_signs_say(pair: tuple[int, int], force: int, moment: int) -> None:
    vehicle = load_vehicle("remus100")
    angle = torch.zeros(4, dtype=torch.float64)
    angle[list(pair)] = 0.05
    nu = torch.tensor([1.54, 0, 0, 0, 0, 0], dtype=torch.float64)
    parts = [torch.tensor(np.array([getattr(f, n) for f in vehicle.fins]))
             for n in ("position", "axis", "area", "lift_slope", "stall")]  # fmt: skip
    wrench = fin_force(nu, angle, *parts, vehicle.water_density).numpy()
    # Y_uudr > 0, Z_uuds < 0, M_uuds = N_uudr < 0, and the pair's own 1030 x 3.12 x 0.00665 = 21.4.
    size = 21.4 * 1.54**2 * 0.05
    assert wrench[force] == pytest.approx(size if force == 1 else -size, rel=0.02)
    assert wrench[moment] == pytest.approx(-0.683 * size, rel=0.02)
    others = [k for k in range(6) if k not in (force, moment)]
    np.testing.assert_allclose(wrench[others], 0.0, atol=0.02)
