"""The standard model stated once more, in JAX, as carefully as JAX allows: jitted scans, vmap, double precision."""

from __future__ import annotations

import os

# One thread for XLA as for everybody else; to be set before JAX starts.
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import jax.numpy as jnp
import numpy as np
from standard import Work

jax.config.update("jax_enable_x64", True)
UNROLL = 4


def statement(work: Work) -> tuple[dict, dict]:
    """Return constants and weights as JAX arrays."""
    prepared, bank = work.model.prepare(), work.model.damping
    form, body = bank.forms[0], prepared.body
    array = lambda x: jnp.asarray(x.detach().numpy())  # noqa: E731
    known = {
        "mass": array(prepared.total),
        "inverse": array(prepared.inverse),
        "lift": array(body.buoyancy - body.weight),
        "arm": array(body.buoyancy * body.cb - body.weight * body.cg),
        "input_scale": array(bank.input_scale),
        "output_scale": array(bank.output_scale),
    }
    weights = {
        "w1": array(form.hidden_weight).reshape(30, 12),
        "b1": array(form.hidden_bias).reshape(30),
        "w2": array(form.output_weight),
        "b2": array(form.output_bias),
    }
    return known, weights


def rate(known: dict, weights: dict, y: jax.Array, tau: jax.Array) -> jax.Array:
    """Return the rate of [position, quaternion, nu]."""
    w, x, yq, z = y[3], y[4], y[5], y[6]
    nu = y[7:]
    v, o = nu[:3], nu[3:]
    rotation = jnp.array(
        [
            [w * w + x * x - yq * yq - z * z, 2 * (x * yq - w * z), 2 * (x * z + w * yq)],
            [2 * (x * yq + w * z), w * w - x * x + yq * yq - z * z, 2 * (yq * z - w * x)],
            [2 * (x * z - w * yq), 2 * (yq * z + w * x), w * w - x * x - yq * yq + z * z],
        ]
    )
    spin = 0.5 * jnp.array(
        [
            -x * o[0] - yq * o[1] - z * o[2],
            w * o[0] + yq * o[2] - z * o[1],
            w * o[1] + z * o[0] - x * o[2],
            w * o[2] + x * o[1] - yq * o[0],
        ]
    )
    scaled = nu / known["input_scale"]
    features = jnp.concatenate([scaled, jnp.abs(scaled) * scaled])
    hidden = jnp.tanh(weights["w1"] @ features + weights["b1"]).reshape(6, 5)
    damping = ((hidden * weights["w2"]).sum(-1) + weights["b2"]) * known["output_scale"]
    momentum = known["mass"] @ nu
    p1, p2 = momentum[:3], momentum[3:]
    coriolis = jnp.concatenate([jnp.cross(o, p1), jnp.cross(v, p1) + jnp.cross(o, p2)])
    down = rotation[2]
    restoring = jnp.concatenate([known["lift"] * down, jnp.cross(known["arm"], down)])
    return jnp.concatenate([rotation @ v, spin, known["inverse"] @ (tau - coriolis - damping - restoring)])


def run(known: dict, weights: dict, y0: jax.Array, command: jax.Array, times: jax.Array) -> jax.Array:
    """Return the states (T, 13) by classical RK4 with held commands, the quaternion at unit length after each step."""

    def step(y: jax.Array, row: tuple) -> tuple[jax.Array, jax.Array]:
        tau, h = row
        k1 = rate(known, weights, y, tau)
        k2 = rate(known, weights, y + 0.5 * h * k1, tau)
        k3 = rate(known, weights, y + 0.5 * h * k2, tau)
        k4 = rate(known, weights, y + h * k3, tau)
        y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        q = y[3:7]
        y = y.at[3:7].set(q / jnp.sqrt((q * q).sum()))
        return y, y

    _, states = jax.lax.scan(step, y0, (command[:-1], times[1:] - times[:-1]), unroll=UNROLL)
    return jnp.concatenate([y0[None], states])


class Peer:
    """Jitted runs of the standard work."""

    def __init__(self, work: Work) -> None:
        self.known, self.weights = statement(work)
        self.y0 = jnp.asarray(np.concatenate([work.eta0.numpy(), work.nu0.numpy()]))
        self.command, self.times = jnp.asarray(work.command.numpy()), jnp.asarray(work.times.numpy())

        def loss(weights: dict, y0: jax.Array, command: jax.Array, times: jax.Array) -> jax.Array:
            return jnp.square(run(self.known, weights, y0, command, times)[:, 7:]).sum()

        def losses(weights: dict, y0: jax.Array, command: jax.Array, times: jax.Array) -> jax.Array:
            return jax.vmap(loss, (None, 0, 0, None))(weights, y0, command, times).sum()

        alone = lambda weights, *given: run(self.known, weights, *given)  # noqa: E731
        self._run = jax.jit(alone)
        self._many = jax.jit(jax.vmap(alone, (None, 0, None, None)))
        self._slope = jax.jit(jax.value_and_grad(loss))
        self._windows = jax.jit(jax.value_and_grad(losses))

    def run(self) -> jax.Array:
        return self._run(self.weights, self.y0, self.command, self.times).block_until_ready()

    def run_and_gradient(self) -> dict:
        return jax.block_until_ready(self._slope(self.weights, self.y0, self.command, self.times))[1]

    def windows(self, y0: np.ndarray, command: np.ndarray, times: np.ndarray) -> dict:
        return jax.block_until_ready(self._windows(self.weights, y0, command, times))[1]

    def many(self, y0: np.ndarray) -> jax.Array:
        return self._many(self.weights, y0, self.command, self.times).block_until_ready()
