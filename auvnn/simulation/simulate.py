"""`simulate`: a log of a model with hidden effects, driven by an excitation, through noisy sensors."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from auvnn.cards import Card, Shown, figure
from auvnn.effects import EFFECTS
from auvnn.effects.sizes import radius
from auvnn.errors import ConfigError
from auvnn.logs import Log
from auvnn.models import GreyBox
from auvnn.models.load_arguments import GivenModel, as_model
from auvnn.plants import PLANTS, Motion, PlantTask
from auvnn.plants.base import refuse
from auvnn.plants.strangers import STRANGERS
from auvnn.simulation.excitations import EXCITATIONS, make_excitation
from auvnn.simulation.noise import make_noise
from auvnn.simulation.plant import as_hidden, drawn_factors, make_plant, typical_values
from auvnn.simulation.recording import _battery, _runs
from auvnn.simulation.requests import _can_be_hidden, _check, _told
from auvnn.simulation.worlds import World, make_world
from auvnn.simulation.worlds.law import disturbed, drawn_laws
from auvnn.simulation.worlds.sensing import Sensing
from auvnn.threads import on_one_thread

Array = NDArray[np.float64]

# Every kind of random number has a separate stream: another noise must not change the manoeuvre.
STREAMS = ("excitation", "noise", "hidden", "voltage", "added_mass", "linear_damping", "quadratic_damping",
           "inertia", "altitude", "law", "force", "sensing")  # fmt: skip


@dataclass(frozen=True, repr=False)
class Simulation(Shown):
    """A made log and the truth behind it.

    Attributes:
        log: what the sensors recorded.
        truth: the content of `truth.json`.
        plant: the model with everything hidden in it that the catalogue of effects knows, as a torch model,
            whichever plant made the motion.
        set_points: what a controller was told to follow, by name, (runs, samples) each; empty in open loop.
        task: what the plant was given.
        motion: what it made of it, at every row at which commands change.
    """

    log: Log
    truth: dict[str, Any]
    plant: GreyBox
    set_points: dict[str, Array] = field(default_factory=dict)
    task: PlantTask | None = None
    motion: Motion | None = None

    def card(self) -> Card:
        """Return what was made, and what is hidden in it."""
        hidden = self.truth.get("hidden") or {}
        rows = [
            [effect, name, figure(value, 4)]
            for effect, values in hidden.items()
            for name, value in values.items()
        ]
        inner = self.log.card()
        return Card(
            f"Simulation of {self.truth.get('model')}",
            f"{inner.line}; hidden: {', '.join(hidden) or 'nothing'}",
            head=("hidden effect", "parameter", "value"),
            rows=rows,
            foot=".log, .truth, .plant",
        )


@on_one_thread
def simulate(
    model: GivenModel,
    excitation: str | Mapping[str, Any] = "multisine",
    noise: str | Mapping[str, Any] = "realistic",
    hidden: Mapping[str, Mapping[str, float] | None] | Sequence[str] | str | None = None,
    seed: int = 0,
    *,
    runs: int = 4,
    duration: float = 150.0,
    rate: float = 20.0,
    coefficients: str = "exact",
    accelerations: bool | None = None,
    actuation: str | None = None,
    max_step: float = 0.01,
    bottom: float | None = None,
    plant: str = "own",
    world: str | Mapping[str, Any] | World | None = None,
) -> Simulation:
    """Make a log: the model with effects hidden in it, driven and measured.

    Commands are held: row k acts from t_k until t_{k+1}. A logged acceleration is that just after row k's
    command has begun to act.

    Args:
        model: what the user knows; excitation and controllers are designed with it.
        excitation: `paper`, `multisine` or `survey`, or a mapping of its options with `name`.
        noise: `none`, `paper` or `realistic`, or a mapping of its options.
        hidden: effects that the log has and the model has not: parameters by name, or None for typical ones.
            With `plant="numpy"` or `"mujoco"` also strangers, effects that are not in the catalogue.
        seed: of all random numbers; the same seed gives the same log.
        runs: how many, numbered from 0; run i does not change when more are asked for.
        duration: of each run, s.
        rate: samples per second.
        coefficients: `exact`, or `drawn`: the plant's added mass, damping and inertia differ from the model's
            by factors 1 + N(0, stated uncertainty). A group that is itself hidden stays exact.
        accelerations: whether to log them; by default as the noise condition says.
        actuation: `thrusters` or `wrench`; by default the model's.
        max_step: longest step of the integrator (RK4), s.
        bottom: depth of a flat bottom, m: the log gets an `altitude`. By default there is one, close below the
            nominal model's deepest point, only where a hidden effect needs it.
        plant: what makes the motion: `own`, the model's own equations; `numpy`, independent ones with an adaptive
            solver; `mujoco`, a physics engine. Excitation, sampling and sensors' noise are the same for all.
        world: what departs from the assumptions of models: `between`, `disturbed_10`, `disturbed_25`, `shaped`,
            `sensors`, `conventions`, `everything`, or a mapping of options. Other laws need `plant="numpy"`.

    Returns:
        Log, truth and plant.

    Raises:
        ConfigError: an option is unknown or out of range, or the plant does not know a hidden effect.
        MissingExtra: the plant's package is not installed.
        AuvnnError: the plant diverges; the message says when and by which term.

    Example:
        ```python
        model = auvnn.load("rov95")
        hidden = {"ocean_current": {"v_north": 0.2}}
        made = auvnn.simulate(model, "multisine", "realistic", hidden, seed=1, runs=1, duration=8.0)
        made.log, made.truth["hidden"]
        ```
    """
    model = as_model(model)
    _check(seed, runs, duration, rate, coefficients, max_step)
    vehicle = model.vehicle
    if vehicle.glides or (vehicle.reduced and plant != "own"):
        raise ConfigError(
            f"{vehicle.name} cannot be simulated so: excitations are forces in six degrees of freedom"
            + (
                "; plant=own knows planes"
                if not vehicle.glides
                else ", and a log's ballast or attitude moves it"
            )
        )
    if accelerations is not None and not isinstance(accelerations, bool):
        raise ConfigError(f"accelerations = {accelerations!r}: true or false is needed, or null")
    manner = make_excitation(excitation, EXCITATIONS)
    condition = make_noise(noise)
    around = make_world(world)
    every = around.every(rate)
    maker = PLANTS.get(plant)()
    model = _actuated(model, actuation)
    truth_hidden: dict[str, dict[str, float]] = {}
    strangers: dict[str, dict[str, float]] = {}
    near = False
    wanted = as_hidden(hidden)
    # Before anything is planned: that takes seconds.
    refuse(maker, wanted)
    for name, values in wanted.items():
        if name in STRANGERS:
            generator = _generator(seed, "hidden", zlib.crc32(name.encode()))
            strangers[name] = STRANGERS.get(name).checked(values, generator)
            continue
        if values is None:
            # Its own stream by its name: the order of the effects must not matter.
            generator = _generator(seed, "hidden", zlib.crc32(name.encode()))
            values = typical_values(EFFECTS.get(name).describe(model.vehicle, model.actuation), generator)
        truth_hidden[name] = values
        _can_be_hidden(model, name, wanted)
        near = near or "altitude" in EFFECTS.get(name).channels
    if bottom is None and near:
        bottom = bottom_below(model, excitation, seed, runs=runs, duration=duration, rate=rate)
    factors = {}
    if coefficients == "drawn":
        streams = {s: _generator(seed, s, 0) for s in STREAMS[4:8]}
        factors = drawn_factors(model.vehicle, list(truth_hidden), streams)
    hiding = make_plant(model, truth_hidden, factors)
    hiding.bottom = bottom

    # Rows of what is commanded; the log has every so many of them.
    t = np.arange(every * round(duration * rate) + 1) / (every * rate)
    with torch.inference_mode():
        plan = manner.plan(model, t, [_generator(seed, "excitation", i) for i in range(runs)])
        sensing = Sensing(
            around.sensors, condition, 1.0 / (every * rate), len(t),
            [_generator(seed, "noise", i) for i in range(runs)], [_generator(seed, "sensing", i) for i in range(runs)],
            _generator(seed, "law", 2),
        )  # fmt: skip
        voltage = _battery(model, t, [_generator(seed, "voltage", i) for i in range(runs)])
    task = PlantTask(
        model.vehicle, model.actuation, {str(e.name): e.values() for e in hiding.members}, strangers, hiding,
        plan.eta0, plan.nu0, t, plan.command, plan.fins, plan.controller, plan.under_way, voltage, bottom, max_step,
        drawn_laws(around, model.vehicle, model.actuation, _generator(seed, "law", 0)),
    )  # fmt: skip
    wandering: dict[str, Any] = {}
    if around.disturbance.share > 0.0:
        bare = make_plant(model, {}, factors)
        known = replace(
            task, effects={str(e.name): e.values() for e in bare.members}, strangers={}, model=bare
        )
        # A controller keeps a memory, so the trial is flown by another one.
        own = manner.plan(model, t, [_generator(seed, "excitation", i) for i in range(runs)])
        forces = [_generator(seed, "force", i) for i in range(runs)]
        known, wandering = disturbed(
            around, maker, replace(known, controller=own.controller), _generator(seed, "law", 1), forces
        )
        task = replace(task, laws=known.laws)
    motion = maker.move(task, sensing.look)
    logged = condition.accelerations if accelerations is None else accelerations
    altitude = None
    if bottom is not None:
        size = condition.standard_deviation.get("altitude", 0.0)
        streams = [_generator(seed, "altitude", i) for i in range(runs)]
        noisy = np.stack([size * g.standard_normal(len(t)) for g in streams])
        altitude = bottom - motion.eta[..., 2] + noisy
    made = _runs(t, motion, voltage, sensing, model.actuation, altitude, logged, every)
    log = Log.from_runs(made, name=f"{model.vehicle.name}-{manner.name}-{seed}")
    truth = {
        "schema": "auvnn/truth/1",
        "hidden": {e.name: e.values() for e in hiding.members if e.name in truth_hidden} | strangers,
        "noise": condition.name,
        "seed": int(seed),
        "model": model.vehicle.name,
        "coefficients": factors,
        "conditions": {
            "excitation": {"name": manner.name, **vars(manner)},
            "noise": condition.to_dict(),
            "actuation": model.actuation,
            "accelerations": logged,
            "runs": runs,
            "duration": float(duration),
            "rate": float(rate),
            "max_step": float(max_step),
            "bottom": bottom,
            "plant": maker.name,
        },
        "notes": list(plan.notes),
    }
    if world is not None:
        truth["world"] = _told(around, task, sensing, wandering)
    thinned = {n: points[:, ::every] for n, points in plan.set_points.items()}
    return Simulation(log, truth, hiding, thinned, task, motion)


def bottom_below(
    model: GreyBox, excitation: str | Mapping[str, Any], seed: int, *, runs: int, duration: float, rate: float
) -> float:
    """Return the depth, m, of a bottom that the nominal model comes close to: 1.3 of its radii below.

    The radius is that of the sphere of the vehicle's volume.

    Args:
        model: nominal.
        excitation: a manoeuvre's name or its options.
        seed: of its draws.
        runs: how many.
        duration: of each, s.
        rate: rows per second.
    """
    nominal = simulate(
        model, excitation, "none", None, seed, runs=runs, duration=duration, rate=rate, max_step=0.025
    )
    deepest = max(float(run.eta[:, 2].max()) for run in nominal.log.runs)
    return deepest + 1.3 * radius(model.vehicle)


def _generator(seed: int, stream: str, index: int) -> np.random.Generator:
    key = (STREAMS.index(stream), index)
    return np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=key))


def _actuated(model: GreyBox, actuation: str | None) -> GreyBox:
    if actuation is None or actuation == model.actuation:
        return model
    effects = [type(e).build(model.vehicle, actuation, e.values()) for e in model.copied_effects()]
    return model.rebuilt(effects, actuation=actuation)
