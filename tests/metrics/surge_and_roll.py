"""A vehicle whose surge and roll are two scalar equations, and logs of it made with scipy alone."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from auvnn.logs import Log, Run
from auvnn.models import GreyBox
from auvnn.testing import plain_vehicle

MASS, ROLL_INERTIA = 70.0, 3.0
LINEAR, QUADRATIC = (30.0, 4.0), (45.0, 6.0)
SURGE, ROLL = 0, 3


def model(linear=LINEAR, quadratic=QUADRATIC, **changes) -> GreyBox:
    """Return the model of 50 + 20 kg and 2 + 1 kg m2 under a commanded wrench; nothing couples u and p."""
    return GreyBox(
        plain_vehicle(
            linear_damping=[linear[0], 30, 30, linear[1], 4, 4],
            quadratic_damping=[quadratic[0], 45, 45, quadratic[1], 6, 6],
            **changes,
        ),
        actuation="wrench",
    )


def rate(k: int, speed, force, linear=LINEAR, quadratic=QUADRATIC):
    """Return u_dot (k = 0) or p_dot (k = 1)."""
    return (force - linear[k] * speed - quadratic[k] * abs(speed) * speed) / (MASS, ROLL_INERTIA)[k]


def run_free(t, start, force, linear=LINEAR, quadratic=QUADRATIC) -> np.ndarray:
    """Return u and p at times t, (N, 2), each force row held until the next time."""
    out = [np.asarray(start, dtype=float)]
    for k in range(len(t) - 1):

        def both(_, y, f=force[k]):
            return [rate(j, y[j], f[j], linear, quadratic) for j in (0, 1)]

        out.append(solve_ivp(both, (t[k], t[k + 1]), out[-1], rtol=1e-9, atol=1e-11).y[:, -1])
    return np.array(out)


def log(
    t,
    force,
    linear=LINEAR,
    quadratic=QUADRATIC,
    noise=0.0,
    seed=0,
    start=(0.3, -0.2),
    number=0,
    accelerations=False,
) -> Log:
    """Return a log of one run; roll is not turned into attitude, which nothing here depends on."""
    clean = run_free(t, start, force, linear, quadratic)
    random = np.random.default_rng(seed)
    nu, wrench, nu_dot = np.zeros((len(t), 6)), np.zeros((len(t), 6)), np.zeros((len(t), 6))
    for j, column in enumerate((SURGE, ROLL)):
        nu[:, column] = clean[:, j] + noise * random.normal(size=len(t))
        wrench[:, column] = force[:, j]
        nu_dot[:, column] = rate(j, clean[:, j], force[:, j], linear, quadratic)
    quaternion = np.tile([1.0, 0, 0, 0], (len(t), 1))
    return Log.from_runs(
        [Run(number, t, quaternion, nu, wrench=wrench, nu_dot=nu_dot if accelerations else None)]
    )


def steps(t, seed=1) -> np.ndarray:
    """Return forces that jump every two seconds, N and N m, (N, 2)."""
    random = np.random.default_rng(seed)
    levels = random.uniform(-1, 1, (int(t[-1] // 2) + 2, 2)) * [40.0, 4.0]
    return levels[(t // 2).astype(int)]
