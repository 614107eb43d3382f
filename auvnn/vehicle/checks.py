"""What a vehicle's matrices must satisfy to be physical."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np

from auvnn.errors import ModelError
from auvnn.vehicle.fields import SMALLEST
from auvnn.vehicle.parts import Array, frozen

DOF = ("X", "Y", "Z", "K", "M", "N")
VELOCITY = ("u", "v", "w", "p", "q", "r")

# Published matrices are rounded: so much asymmetry, relative to the diagonal, is averaged away.
ASYMMETRY = 1e-3
# The velocities over which quadratic damping must not add energy: m/s and rad/s.
BOX = np.array([3.0, 3.0, 3.0, 2.0, 2.0, 2.0])
_ROUNDING = 1e-9


def symmetrized(matrix: Array, where: str, field: str) -> Array:
    """Return the matrix, symmetric to the last bit.

    Args:
        matrix: (n, n).
        where: of the file, for messages.
        field: its name.

    Raises:
        ModelError: it differs from its transpose by more than rounding.
    """
    size = np.sqrt(np.abs(np.outer(np.diag(matrix), np.diag(matrix)))) + _ROUNDING * np.abs(matrix).max()
    difference = np.abs(matrix - matrix.T)
    worst = np.unravel_index(np.argmax(difference - ASYMMETRY * size), matrix.shape)
    if difference[worst] > ASYMMETRY * size[worst]:
        i, j = (int(k) for k in worst)
        raise ModelError(
            f"{where}: {field} is not symmetric: [{i}][{j}] is {matrix[i, j]:g} but [{j}][{i}] is "
            f"{matrix[j, i]:g}; correct one of the two"
        )
    return (matrix + matrix.T) / 2 if difference.any() else matrix


def check_inertia(inertia: Array, where: str) -> None:
    """Refuse an inertia that no body can have: Fossen's I_g must be positive and I_1 + I_2 >= I_3.

    Raises:
        ModelError: with the offending component or principal moments.
    """
    for i, axis in enumerate("xyz"):
        if not inertia[i, i] >= SMALLEST:
            raise ModelError(
                f"{where}: inertia[{i}][{i}] (I_{axis}{axis}) is {inertia[i, i]:g}: must be positive; give "
                "the moment of inertia about the centre of gravity in kg m2"
            )
    low, middle, high = np.linalg.eigvalsh(inertia)
    if not low > _ROUNDING * high:
        raise ModelError(
            f"{where}: inertia is not positive definite: its smallest eigenvalue is {low:g} kg m2; check the "
            "products of inertia and their signs"
        )
    if high > (low + middle) * (1 + 1e-6):
        raise ModelError(
            f"{where}: inertia has the principal moments {low:g}, {middle:g}, {high:g} kg m2: no body has "
            "one larger than the sum of the others; check the three values"
        )


def rigid_body(mass: float, inertia: Array, r: Array) -> Array:
    """Return M_RB about the body origin, (6, 6): [m I, -m S(r); m S(r), I_g + m (r^T r I - r r^T)], r = r_g.

    Reference: Fossen, Handbook of Marine Craft Hydrodynamics and Motion Control, ch. 3.

    Args:
        mass: kg.
        inertia: I_g about the centre of gravity, (3, 3), kg m2.
        r: centre of gravity in the body frame, (3,), m.
    """
    x, y, z = r
    s = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    upper = np.hstack([mass * np.eye(3), -mass * s])
    lower = np.hstack([mass * s, inertia + mass * (r @ r * np.eye(3) - np.outer(r, r))])
    return np.vstack([upper, lower])


def check_added_mass(added_mass: Array, rigid_body: Array, where: str) -> str | None:
    """Refuse added mass of the wrong sign or with M_RB + M_A indefinite; return a doubt, or None.

    Args:
        added_mass: M_A, (6, 6).
        rigid_body: M_RB, (6, 6).
        where: of the file, for messages.

    Raises:
        ModelError: with the smallest eigenvalue of M_RB + M_A.
    """
    smallest = float(np.linalg.eigvalsh(rigid_body + added_mass).min())
    diagonal = np.diag(added_mass)
    words = f"the smallest eigenvalue of M_RB + M_A is {smallest:.6g}"
    negative = [i for i in range(6) if diagonal[i] < 0]
    if negative and not (diagonal > 0).any():
        raise ModelError(
            f"{where}: added_mass has the wrong sign: its diagonal is {_list(diagonal)} and {words}; these "
            "look like the derivatives X_udot ... N_rdot, give M_A = -diag(X_udot, ...), turning every sign"
        )
    if negative:
        i = negative[0]
        raise ModelError(
            f"{where}: added_mass[{i}][{i}] is {diagonal[i]:g}: the diagonal of an ordinary body's added "
            f"mass is not negative ({words}); turn the sign"
        )
    scale = np.sqrt(np.diag(rigid_body + added_mass))
    scaled = np.linalg.eigvalsh((rigid_body + added_mass) / np.outer(scale, scale))
    if not scaled.min() > _ROUNDING:
        raise ModelError(
            f"{where}: added_mass: M_RB + M_A is not positive definite: {words}; check its off-diagonal "
            "values and signs"
        )
    alone = float(np.linalg.eigvalsh(added_mass).min())
    if alone < -_ROUNDING * max(float(np.abs(added_mass).max()), 1.0):
        return f"added_mass alone is not positive semi-definite (smallest eigenvalue {alone:.3g})"
    return None


def check_linear_damping(damping: Array, where: str) -> None:
    """Refuse linear damping that adds energy: nu^T D_L nu must not be negative.

    Raises:
        ModelError: with the velocity at which it adds energy.
    """
    _check_damping_diagonal(damping, where, "linear_damping", "X_u")
    values, vectors = np.linalg.eigh((damping + damping.T) / 2)
    if values[0] < -_ROUNDING * max(float(np.abs(damping).max()), _ROUNDING):
        worst = vectors[:, 0]
        raise ModelError(
            f"{where}: linear_damping adds energy: nu^T D_L nu is {values[0]:.4g} at {_velocity(worst)} (the "
            "smallest eigenvalue of its symmetric part); check the off-diagonal values and signs"
        )


def check_quadratic_damping(damping: Array, where: str) -> None:
    """Refuse quadratic damping that adds energy: nu^T D_Q (|nu| nu) over a box of velocities.

    Raises:
        ModelError: with the velocity at which it adds energy.
    """
    _check_damping_diagonal(damping, where, "quadratic_damping", "X_u|u|")
    if not (damping - np.diag(np.diag(damping))).any():
        return
    nu = sampled_velocities()
    power = (nu @ damping * (np.abs(nu) * nu)).sum(1)
    scale = (np.abs(nu) @ np.abs(damping) * (nu * nu)).sum(1)
    relative = power / np.maximum(scale, np.finfo(float).tiny)
    worst = int(np.argmin(relative))
    if relative[worst] < -_ROUNDING:
        raise ModelError(
            f"{where}: quadratic_damping adds energy: nu^T D_Q (|nu| nu) is {power[worst]:.4g} W at "
            f"{_velocity(nu[worst])}; check the off-diagonal values and signs"
        )


@cache
def sampled_velocities() -> Array:
    """Return velocities that fill the box: all pairs of axes on a grid, and random ones over two decades."""
    ratios = np.concatenate([-np.geomspace(1.0, 0.01, 21), np.geomspace(0.01, 1.0, 21)])
    a, b = (grid.ravel() for grid in np.meshgrid(ratios, ratios))
    pairs = []
    for i, j in combinations(range(6), 2):
        nu = np.zeros((a.size, 6))
        nu[:, i], nu[:, j] = a, b
        pairs.append(nu)
    random = np.random.default_rng(0)
    size = 10.0 ** random.uniform(-2.0, 0.0, (20_000, 6))
    signed = size * random.choice([-1.0, 1.0], size.shape)
    return frozen(np.concatenate([*pairs, signed]) * BOX)


def _check_damping_diagonal(damping: Array, where: str, field: str, symbol: str) -> None:
    diagonal = np.diag(damping)
    negative = [i for i in range(6) if diagonal[i] < 0]
    if negative and not (diagonal > 0).any():
        raise ModelError(
            f"{where}: {field} has the wrong sign: its diagonal is {_list(diagonal)}; these look like the "
            f"derivatives {symbol} ..., give D = -diag({symbol}, ...), turning every sign"
        )
    if negative:
        i = negative[0]
        raise ModelError(
            f"{where}: {field}[{i}][{i}] is {diagonal[i]:g}: this adds energy in {VELOCITY[i]}; drag is "
            "positive, turn the sign"
        )


def _list(values: Array) -> str:
    return "[" + ", ".join(f"{x:g}" for x in values) + "]"


def _velocity(nu: Array) -> str:
    parts = [f"{name}={x:.3g}" for name, x in zip(VELOCITY, nu, strict=True) if abs(x) > 1e-6]
    return " ".join(parts)
