"""First-order recurrences over time, by few operations on whole arrays."""

from __future__ import annotations

import torch

from auvnn.shapes import Rows, RowShares, StepShares


def first_order_recurrence(left: RowShares, added: Rows) -> Rows:
    """Return x_k = left_k x_(k-1) + added_k with x = 0 before the first row, (..., T, n), in log2(T) steps.

    A loop over rows costs as many operations as there are rows, and its derivatives cost several times that.

    Args:
        left: share of x that is left after a row, (..., T, 1) or (..., T, n).
        added: what a row adds, (..., T, n).

    Reference: Blelloch (1990), Prefix sums and their applications, CMU-CS-90-190, section 1.4.
    """
    left, added = torch.broadcast_tensors(left, added)
    reach = 1
    while reach < added.shape[-2]:
        here, before = slice(reach, None), slice(None, -reach)
        more = added[..., here, :] + left[..., here, :] * added[..., before, :]
        further = left[..., here, :] * left[..., before, :]
        added = torch.cat([added[..., :reach, :], more], dim=-2)
        left = torch.cat([left[..., :reach, :], further], dim=-2)
        reach *= 2
    return added


def closing_gap(demand: Rows, left: StepShares) -> Rows:
    """Return x - demand as each row begins, (..., T, n), of what closes a share of its gap to the demand in each row.

    It begins at the first demand. Where the demand stays, the gap is zero to the last bit.

    Args:
        demand: held over each row, (..., T, n).
        left: share of the gap that is left at the end of each row but the last, (..., T - 1, 1) or (..., T - 1, n).
    """
    gaps = first_order_recurrence(left, demand[..., :-1, :] - demand[..., 1:, :])
    return torch.nn.functional.pad(gaps, (0, 0, 1, 0))
