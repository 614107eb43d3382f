"""What comes in: numbers into tensors, and the samples that must not be used, by reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from auvnn.errors import ConfigError
from auvnn.models import GreyBox
from auvnn.online.guards import Guards
from auvnn.online.residual import Sample

# A quaternion's length may be this far from one: rounding and interpolation, not a fault. It is then normalised.
UNIT = 0.05


# s, to which a stamp must be exact.
COARSEST = 0.01


def tensor(value: Any, name: str, sizes: tuple[int, ...]) -> Tensor:
    """Return numbers as a double vector of one of the sizes; 0 stands for a scalar.

    Args:
        value: numbers of any kind.
        name: what they are, for the message.
        sizes: that are allowed.

    Raises:
        ConfigError: they are no numbers, or of another size.
    """
    try:
        if isinstance(value, Tensor):
            found = value.detach().to("cpu", torch.float64).clone()
        else:
            found = torch.tensor(np.array(value, dtype=np.float64))
    except (TypeError, ValueError, RuntimeError) as error:
        raise ConfigError(f"adapter: {name} is no vector of numbers ({error})") from error
    shape = tuple(found.shape)
    if shape not in [(size,) if size else () for size in sizes]:
        wanted = " or ".join("a number" if size == 0 else str(size) for size in sizes)
        raise ConfigError(f"adapter: {name} has shape {shape}: give {wanted}")
    return found


def sample_of(
    model: GreyBox,
    t: float,
    eta: Any,
    nu: Any,
    command: Any,
    nu_dot: Any = None,
    fins: Any = None,
    voltage: Any = None,
    altitude: Any = None,
) -> Sample | None:
    """Return a sample, or None where a number is missing or not finite; see `refusal` for what else is not used.

    Args:
        model: for the number of commands and fins.
        t: s.
        eta: position and quaternion (7,), or with Euler angles (6,).
        nu: velocity, m/s and rad/s, (6,).
        command: (n,).
        nu_dot: measured acceleration, m/s2 and rad/s2, (6,), or None.
        fins: fin angles, rad, (m,), or None.
        voltage: V, or None.
        altitude: m, or None.

    Raises:
        ConfigError: a vector has the wrong size, or the stamp is of a type too coarse for it.
    """
    state = (
        tensor(eta, "eta", (7, 6)),
        tensor(nu, "nu", (6,)),
        tensor(command, "command", (model.actuators.size,)),
    )
    others: dict[str, Tensor | None] = {
        "nu_dot": None if nu_dot is None else tensor(nu_dot, "nu_dot", (6,)),
        "fins": None if fins is None else tensor(fins, "fins", (len(model.vehicle.fins),)),
        "voltage": None if voltage is None else tensor(voltage, "voltage", (0,)),
        "altitude": None if altitude is None else tensor(altitude, "altitude", (0,)),
    }
    time = tensor(t, "t", (0,))
    _fine_enough(t)
    given = [time, *state, *(v for v in others.values() if v is not None)]
    if not all(bool(torch.isfinite(v).all()) for v in given):
        return None
    return Sample.of(float(time), *state, **others)


def _fine_enough(t: Any) -> None:
    """Refuse a stamp whose type is too coarse for its value: a float32 of 1.7e9 s stands still for two minutes.

    Raises:
        ConfigError: its next larger value lies more than `COARSEST` away.
    """
    if (
        not isinstance(t, (Tensor, np.ndarray, np.generic))
        or "float" not in str(t.dtype)
        or "64" in str(t.dtype)
    ):
        return
    value = np.float32(float(t)) if "float32" in str(t.dtype) else np.float16(float(t))
    if np.isfinite(value) and np.spacing(np.abs(value)) > COARSEST:
        raise ConfigError(
            f"adapter: t is {value:.7g} s in {str(t.dtype).removeprefix('torch.')}, exact to "
            f"{np.spacing(np.abs(value)):.2g} s only: give it as float64, or count from the first sample"
        )


def turned(sample: Sample) -> Sample | None:
    """Return a sample with its quaternion at length one, or None where its length is too far from that."""
    length = float(torch.linalg.vector_norm(sample.eta[3:]))
    if not abs(length - 1.0) <= UNIT:
        return None
    if abs(length - 1.0) < 1e-12:
        return sample
    return replace(sample, eta=torch.cat([sample.eta[:3], sample.eta[3:] / length]))


def refusal(sample: Sample, last: Sample | None, guards: Guards, now: float | None) -> str | None:
    """Return why a sample is not used at all, or None.

    Args:
        sample: that came in.
        last: that was used before, or None.
        guards: with the limits.
        now: when it came in, s, or None.
    """
    if now is not None and guards.max_age is not None and now - sample.t > guards.max_age:
        return "stale"
    if last is None:
        return None
    if sample.t == last.t:
        return "repeated"
    if sample.t < last.t:
        return "out_of_order"
    if not guards.enabled:
        return None
    # Measured velocities of a vehicle that moves are never twice the same to the last bit.
    same = bool((sample.nu == last.nu).all()) and bool((sample.eta == last.eta).all())
    return "repeated" if same and bool((sample.nu != 0).any()) else None
