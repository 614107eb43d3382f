"""Hidden effects of a stated size: so many standard errors of a fit that knows everything else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.catalogue import unknown_name
from auvnn.diagnosis.hypotheses.candidates import windows_for
from auvnn.diagnosis.hypotheses.stated_priors import has_stated_uncertainty, lay_out
from auvnn.diagnosis.score_tests.probes import extent_of
from auvnn.effects import Effect, Parameter
from auvnn.errors import ConfigError
from auvnn.estimation.priors import set_parameters
from auvnn.estimation.window_normal_equations import linearise, normal_equations
from auvnn.logs import Log
from auvnn.logs.without_sensors import without as lacking
from auvnn.metrics.free_run import initial_states, moved
from auvnn.metrics.unmeasured import completed
from auvnn.metrics.windows import cut_windows
from auvnn.models import GreyBox
from auvnn.simulation import bottom_below, simulate

Array = NDArray[np.float64]

SIZES = {"small": 5.0, "medium": 10.0, "large": 30.0}
# A coefficient is missing only where it is off by more than was stated of it, so its size counts those amounts
# too: the factor's logarithm is so many times the stated relative uncertainty. Ours, not the literature's.
BEYOND = {"small": 2.5, "medium": 4.0, "large": 6.0}
# White noise of measured accelerations, m/s2 and rad/s2, of which the realistic condition says nothing: a good
# accelerometer, and the differences of a gyroscope's rates.
ACCELERATION_NOISE = {**dict.fromkeys(("du", "dv", "dw"), 0.02), **dict.fromkeys(("dp", "dq", "dr"), 0.05)}


def oracle_information(
    model: GreyBox, log: Log, name: str, sigma: Array, shape: Mapping[str, float] | None = None
) -> Array:
    """Return the information (p, p) that a log holds on one effect when everything else is known.

    The initial state of each window is not known; noise has the given standard deviations (18,). An effect
    with a shape is taken at the given one, otherwise at its null.

    Args:
        model: as known.
        log: whose windows are taken.
        name: of the effect, with p parameters.
        sigma: standard deviation of each channel, (18,).
        shape: values of its parameters of shape.
    """
    layout = lay_out(model, [name])
    member = layout.model.effect(name)
    values = np.array([(shape or {}).get(p.name, p.null) for p in member.parameters_of])
    set_parameters(layout.model, [name], values)
    windows = windows_for(model, log)
    states = initial_states(layout.model, windows)
    for _ in range(2):
        sums, change, _ = normal_equations(windows, linearise(layout.model, windows, states, [name]), sigma)
        states = moved(states, torch.as_tensor(change))
    return sums.total


def _shape(
    kind: type[Effect], described: Sequence[Parameter], log: Log, generator: np.random.Generator
) -> dict[str, float]:
    """Return a plausible shape: between the ones that the diagnosis starts from, else near the null."""
    if not any(p.shape for p in described):
        return {}
    starts = kind.starts(tuple(described), extent_of(cut_windows(log, 5.0, partial=True)))
    # Between two of them: an onset then lies well inside the log.
    one, other = (starts[k % len(starts)] for k in generator.choice(max(len(starts), 2), 2, replace=False))
    share = generator.uniform()
    shape = {}
    for p in described:
        if p.shape:
            value = p.null + 0.5 * p.scale * generator.normal()
            if p.name in one:
                value = share * one[p.name] + (1 - share) * other[p.name]
            shape[p.name] = float(np.clip(value, p.low, p.high))
    return shape


def drawn_direction(
    model: GreyBox, effect: str, log: Log, seed: int
) -> tuple[tuple[Parameter, ...], Array, dict[str, float]]:
    """Return an effect's parameters, a random direction in units of their scales, rms one, and a plausible shape.

    Args:
        model: as known.
        effect: its name.
        log: for plausible shapes.
        seed: of the draws.
    """
    member = model.with_effects({effect: {}}).effect(effect)
    described = tuple(member.parameters_of)
    generator = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(101,)))
    direction = generator.normal(size=len(described))
    direction = np.where([p.low == p.null for p in described], np.abs(direction), direction)
    shape = _shape(type(member), described, log, generator)
    live = direction[[not p.shape for p in described]]
    return described, direction / max(float(np.sqrt(np.mean(live**2))), 1e-6), shape


def sized(
    model: GreyBox,
    effect: str,
    size: str,
    *,
    excitation: str | Mapping[str, Any] = "multisine",
    noise: str | Mapping[str, Any] = "realistic",
    seed: int = 0,
    runs: int = 4,
    duration: float = 60.0,
    rate: float = 20.0,
    accelerations: bool | None = None,
    without: Sequence[str] = (),
) -> dict[str, float]:
    """Return parameters of an effect in a random direction and of a stated size.

    Directions are drawn in units of the parameters' plausible scales. The size is the Mahalanobis distance
    from the null under the oracle's information, always for realistic noise, so that a noise-free log hides
    the same effects as a noisy one.

    Args:
        model: what the user knows.
        effect: name.
        size: small, medium or large: 5, 10 or 30 standard errors.
        excitation: as in `simulate`.
        noise: not used for the size; taken so that the same options serve both.
        seed: of direction and manoeuvre.
        runs: of the log.
        duration: of each run, s.
        rate: samples per second.
        accelerations: whether the log will have them. They count only for an effect that needs them, so that all
            others have the same size with and without.
        without: channels that the log will lack; the oracle lacks them too.

    Raises:
        ConfigError: an unknown size or effect, or one that the manoeuvre says nothing about.
    """
    del noise
    if size not in SIZES:
        raise ConfigError(unknown_name("size", size, SIZES))
    layout = lay_out(model, [effect])
    described = layout.model.effect(effect).parameters_of
    scale = np.array([p.scale for p in described])
    fixed = np.array([p.shape for p in described])
    generator = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(101,)))
    direction = generator.normal(size=len(described))
    direction = np.where([p.low == p.null for p in described], np.abs(direction), direction)
    uncertain = has_stated_uncertainty(model)
    if effect in uncertain:
        direction = np.clip(direction / np.sqrt(np.mean(direction**2)), -1.5, 1.5)
        factors = np.exp(BEYOND[size] * uncertain[effect] * direction)
        return {p.name: float(f) for p, f in zip(described, factors, strict=True)}
    bottom = None
    if "altitude" in type(layout.model.effect(effect)).channels:
        bottom = bottom_below(model, excitation, seed, runs=runs, duration=duration, rate=rate)
    felt = accelerations is True and bool(
        ACCELERATION_NOISE.keys() & set(type(layout.model.effect(effect)).channels)
    )
    made = simulate(
        model, excitation, "realistic", None, seed,
        runs=runs, duration=duration, rate=rate, max_step=0.025, bottom=bottom, accelerations=felt,
    )  # fmt: skip
    further = list(ACCELERATION_NOISE.values()) if felt else [np.inf] * 6
    sigma = np.array([0.05, 0.05, 0.01, 0.003, 0.003, 0.008] + [0.006] * 3 + [0.003] * 3 + further)
    shape = _shape(type(layout.model.effect(effect)), described, made.log, generator)
    log = completed(model, lacking(made.log, without))
    information = oracle_information(model, log, effect, sigma, shape)
    step = np.where(fixed, 0.0, direction * scale)
    distance = float(np.sqrt(step @ information @ step))
    if not distance > 1e-9:
        raise ConfigError(
            f"{effect} leaves no trace on {model.vehicle.name} under this excitation: choose another"
        )
    at = np.array([shape.get(p.name, p.null) for p in described])
    values = at + step * (SIZES[size] / distance)
    return {p.name: float(np.clip(v, p.low, p.high)) for p, v in zip(described, values, strict=True)}
