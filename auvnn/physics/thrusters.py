"""Thrusters: from commands to thrust, and from thrust to the wrench on the vehicle."""

from __future__ import annotations

import torch

from auvnn.physics.products import cross
from auvnn.shapes import Allocation, Knots, PerPart, Vectors3


def allocation_matrix(positions: Vectors3, directions: Vectors3) -> Allocation:
    """Return the matrix B from thrusts to the wrench: tau = B T, with columns b_i = [d_i ; r_i x d_i].

    Args:
        positions: of the thrusters in body axes, m (..., n, 3).
        directions: of the force on the vehicle for a positive thrust, unit vectors (..., n, 3).

    Returns:
        (..., 6, n). Fossen 2011, section 12.3.
    """
    moments = cross(positions, directions)
    return torch.cat((directions.expand_as(moments), moments), -1).mT


def quadratic_thrust(command: PerPart, max_forward: PerPart, max_reverse: PerPart) -> PerPart:
    """Return the thrust of the quadratic law: T = T_max c |c|, with another T_max in reverse.

    Args:
        command: in [-1, 1] (..., n); beyond it the law goes on, limits are the caller's.
        max_forward: thrust at c = 1, N (n) or (..., n).
        max_reverse: size of the thrust at c = -1, N (n) or (..., n), positive.

    Returns:
        (..., n), N. Fossen 2011, section 12.3 (T proportional to n |n|).
    """
    return torch.where(command > 0.0, max_forward, max_reverse) * (command.abs() * command)


def table_thrust(command: PerPart, command_grid: Knots, thrust_grid: Knots) -> PerPart:
    """Return the thrust of a table, linear between its points and held at its ends.

    At a point of the table the slope is that of the piece to its right.

    Args:
        command: (..., n).
        command_grid: rising commands of the table, (k) for all thrusters or (n, k) for each its own; k >= 2.
        thrust_grid: thrust at these commands, N, of the same shape.

    Returns:
        (..., n), N.
    """
    c = torch.clamp(command, command_grid[..., 0], command_grid[..., -1])
    if command_grid.dim() == 1:
        at = torch.bucketize(c.detach().contiguous(), command_grid[1:-1].contiguous(), right=True)
        slope = (thrust_grid[1:] - thrust_grid[:-1]) / (command_grid[1:] - command_grid[:-1])
        return thrust_grid[at] + slope[at] * (c - command_grid[at])
    piece = (c.unsqueeze(-1) >= command_grid[..., 1:-1]).sum(-1)
    left, base = torch.broadcast_tensors(command_grid[..., :-1], thrust_grid[..., :-1])
    pieces = torch.stack((left, base, (thrust_grid[..., 1:] - base) / (command_grid[..., 1:] - left)), -1)
    rank = max(piece.dim() + 2, pieces.dim())
    index = piece[(None,) * (rank - piece.dim() - 2)][..., None, None]
    own = torch.take_along_dim(pieces[(None,) * (rank - pieces.dim())], index, -2).squeeze(-2)
    start, low, slope = own.unbind(-1)
    return low + slope * (c - start)


def summed_table_thrust(command: PerPart, command_grid: Knots, thrust_grid: Knots) -> PerPart:
    """Return the thrust of a table as a sum of kinks: T = (T_0 + T_n) / 2 + sum_k (s_k - s_k-1) / 2 |c - c_k|.

    s_k is the slope of the piece after the point k, zero before the first point and after the last. The same function
    as `table_thrust` to rounding, without an index that depends on the command, so that it can be written as
    straight-line code; at a point of the table its slope is the mean of both sides.

    Args:
        command: (...).
        command_grid: rising commands of the table, (..., k), k >= 2.
        thrust_grid: thrust at these commands, N, (..., k).

    Returns:
        (...), N.
    """
    rise = thrust_grid[..., 1:] - thrust_grid[..., :-1]
    slope = rise / (command_grid[..., 1:] - command_grid[..., :-1])
    level = torch.zeros_like(slope[..., :1])
    kink = 0.5 * (torch.cat((slope, level), dim=-1) - torch.cat((level, slope), dim=-1))
    away = (command.unsqueeze(-1) - command_grid).abs()
    return 0.5 * (thrust_grid[..., 0] + thrust_grid[..., -1]) + (kink * away).sum(-1)
