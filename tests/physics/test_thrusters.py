"""Thrusters: allocation by cross products, both directions of the thrust law, and tables."""

import numpy as np
import torch

from auvnn.physics.thrusters import allocation_matrix, quadratic_thrust, table_thrust


def tensor(values):
    return torch.tensor(values, dtype=torch.float64)


def test_allocation_is_force_and_cross_product(draw):
    positions, directions, thrust = draw(5, 3), draw(5, 3), draw(5)
    forces = thrust[:, None].numpy() * directions.numpy()
    expected = np.r_[forces.sum(0), np.cross(positions.numpy(), forces).sum(0)]
    np.testing.assert_allclose(
        (allocation_matrix(positions, directions) @ thrust).numpy(), expected, atol=1e-13
    )


def test_allocation_signs_by_hand():
    """Forward thrust to port of the centre turns to starboard; below the centre it raises the nose."""
    column = allocation_matrix(tensor([[0.0, -0.2, 0.1]]), tensor([[1.0, 0.0, 0.0]]))[:, 0]
    torch.testing.assert_close(column, tensor([1.0, 0, 0, 0, 0.1, 0.2]))


def test_quadratic_forward_and_reverse():
    forward, reverse = tensor([90.0] * 5), tensor([72.0] * 5)
    thrust = quadratic_thrust(tensor([-1.0, -0.5, 0.0, 0.5, 1.0]), forward, reverse)
    torch.testing.assert_close(thrust, tensor([-72.0, -18.0, 0.0, 22.5, 90.0]))


def test_quadratic_is_flat_at_zero():
    one = tensor([90.0])
    for jacobian in (torch.func.jacfwd, torch.func.jacrev):
        assert jacobian(lambda c: quadratic_thrust(c, one, 0.8 * one))(tensor([0.0])).item() == 0.0


def test_table_against_numpy():
    grid, values = tensor([-1.0, -0.3, -0.1, 0.1, 0.5, 1.0]), tensor([-40.0, -9.0, 0.0, 0.0, 20.0, 50.0])
    command = torch.linspace(-1.3, 1.3, 400, dtype=torch.float64).reshape(100, 4)
    expected = np.interp(command.numpy(), grid.numpy(), values.numpy())
    np.testing.assert_allclose(table_thrust(command, grid, values).numpy(), expected, atol=1e-12)
    np.testing.assert_allclose(table_thrust(grid, grid, values).numpy(), values.numpy(), atol=1e-12)


def test_each_thruster_with_its_own_table(draw):
    grid = draw(3, 7).sort(-1).values
    values, command = draw(3, 7), 2.0 * draw(50, 3)
    expected = [np.interp(command[:, i].numpy(), grid[i].numpy(), values[i].numpy()) for i in range(3)]
    np.testing.assert_allclose(table_thrust(command, grid, values).numpy(), np.stack(expected, 1), atol=1e-12)


def test_slope_of_the_table_is_that_of_the_piece_to_the_right():
    grid, values = tensor([-1.0, 0.0, 1.0]), tensor([-30.0, 0.0, 50.0])
    for command, slope in [(-2.0, 0.0), (-1.0, 30.0), (-0.5, 30.0), (0.0, 50.0), (0.5, 50.0), (2.0, 0.0)]:
        for jacobian in (torch.func.jacfwd, torch.func.jacrev):
            got = jacobian(lambda c: table_thrust(c, grid, values))(tensor([command]))
            assert got.item() == slope


def test_two_points_are_a_table():
    grid, values = tensor([-1.0, 1.0]), tensor([-10.0, 10.0])
    torch.testing.assert_close(table_thrust(tensor([-3.0, 0.5]), grid, values), tensor([-10.0, 5.0]))
