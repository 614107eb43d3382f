"""Tests with few windows: how well the variance of the scores is known, and whether that counts."""

from __future__ import annotations

# Degrees of freedom of the scores' variance that are believed where there are few windows.
FEW = 40.0


def are_few(windows: int, spent: int) -> bool:
    """Whether windows are so few that it counts how much of each window's noise a fit of `spent` parameters takes."""
    return windows - spent + 1 < FEW


def freedom(windows: int, degrees: int) -> float:
    """Return the degrees of freedom with which the scores' variance is known.

    With many windows, those of a whole covariance of the scores (Hotelling, 1931, Ann. Math. Stat. 2), which is safe
    where correlation inflates some directions more than others. What is estimated is one number, though, the mean of
    as many directions as there are parameters, with neighbours at half weight: with few windows, long ones of
    vehicles without velocities, that is all there is, and it is worth up to `FEW`.

    Args:
        windows: B.
        degrees: parameters that are tested.
    """
    one_number = degrees * (windows - 1) / (1.0 + 2.0 * 0.5**2)
    return max(windows - degrees, min(FEW, one_number), 4.0)
