"""What a plant is: from a start, commands and hidden effects to the true motion and what sensors make of it."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from auvnn.errors import AuvnnError, ConfigError
from auvnn.plants.laws import USUAL, Laws
from auvnn.vehicle import Vehicle

Array = NDArray[np.float64]

# Beyond these speeds, m/s and rad/s, no underwater vehicle is meant: the integration has diverged.
LIMIT = 100.0

# What the sensors make of row k: position (R, 3), quaternion (R, 4) and nu (R, 6), from those without noise.
Look = Callable[[int, Array, Array, Array], tuple[Array, Array, Array]]

Controller = Callable[[int, Array, Array, Array], tuple[Array, "Array | None"]]


@dataclass(frozen=True)
class PlantTask:
    """What R runs of T rows begin with, what is hidden in them, and what they are told to do.

    Attributes:
        vehicle: the known numbers.
        actuation: "thrusters" or "wrench".
        effects: all effects that act, name to parameters, in order of action: those of the model, those that are
            hidden, drawn coefficients (as factors, `inertia` among them).
        strangers: effects outside the catalogue, name to parameters.
        model: the same as a torch model, without the strangers. Only the plant `own` looks at it.
        eta0: first position and attitude, (R, 7).
        nu0: first velocity, (R, 6), over ground, or through the water where `under_way`.
        t: times of the rows, s, (T,).
        command: thruster commands or wrench, (R, T, n), each held until the next row; None where a controller
            makes them.
        fins: fin angles, rad, (R, T, m), or None for fins held at zero.
        controller: makes the commands from what is measured, or None in open loop.
        under_way: the vehicle starts in steady motion through the water, whatever the water does.
        voltage: V, (R, T), or None.
        bottom: depth of a flat bottom, m, or None.
        max_step: longest step of an integrator that does not choose its own, s.
        laws: where the world departs from the usual equations; only the plant `numpy` obeys them.
    """

    vehicle: Vehicle
    actuation: str
    effects: Mapping[str, Mapping[str, float]]
    strangers: Mapping[str, Mapping[str, float]]
    model: Any
    eta0: Array
    nu0: Array
    t: Array
    command: Array | None = None
    fins: Array | None = None
    controller: Controller | None = None
    under_way: bool = False
    voltage: Array | None = None
    bottom: float | None = None
    max_step: float = 0.01
    laws: Laws = USUAL


@dataclass(frozen=True)
class Motion:
    """The true motion, and what sensors without noise report of it; all in SI, NED and FRD.

    Attributes:
        eta: true position and quaternion, (R, T, 7).
        nu: true velocity over ground, (R, T, 6).
        nu_dot: its derivative just after each row's command has begun to act, (R, T, 6).
        position: reported, (R, T, 3).
        quaternion: reported, (R, T, 4).
        velocity: reported, (R, T, 6).
        rate: reported derivative of the velocity, (R, T, 6).
        command: what was held, (R, T, n).
        fins: what was held, rad, (R, T, m), or None.
    """

    eta: Array
    nu: Array
    nu_dot: Array
    position: Array
    quaternion: Array
    velocity: Array
    rate: Array
    command: Array
    fins: Array | None


class Plant(ABC):
    """Makes the motion. A member of the catalogue is a class without options."""

    name: ClassVar[str]

    @abstractmethod
    def refuses(self, effect: str) -> str:
        """Return why the plant cannot have an effect hidden in it, or nothing."""

    @abstractmethod
    def move(self, task: PlantTask, look: Look) -> Motion:
        """Return the motion of all runs.

        Args:
            task: what to do.
            look: what a controller gets to see.

        Raises:
            ConfigError: the plant does not know an effect, or cannot represent the vehicle.
            MissingExtra: its package is not installed.
            AuvnnError: the motion diverges.
        """


class Stretch(Protocol):
    """All runs of a log on their way: what `drive` moves from row to row."""

    def report(self) -> tuple[Array, Array, Array]:
        """Return what sensors without noise report: position (R, 3), quaternion (R, 4), nu (R, 6)."""
        ...

    def hold(self, command: Array, fins: Array | None, voltage: Array | None) -> None:
        """Hold commands (R, n), fin angles (R, m) and voltage (R,) from this row to the next, and move there.

        Args:
            command: (R, n).
            fins: fin angles, rad, (R, m), or None.
            voltage: V, (R,), or None.
        """
        ...

    def motion(self) -> Motion:
        """Return what has been, once all rows are done."""
        ...


def drive(stretch: Stretch, task: PlantTask, look: Look) -> Motion:
    """Move through all rows of a task, under its commands or its controller.

    Args:
        stretch: the vehicles on their way.
        task: rows, commands or controller.
        look: what the sensors make of a row.
    """
    for k in range(len(task.t)):
        if task.controller is not None:
            command, fins = task.controller(k, *look(k, *stretch.report()))
        else:
            assert task.command is not None
            command = task.command[:, k]
            fins = None if task.fins is None else task.fins[:, k]
        stretch.hold(command, fins, None if task.voltage is None else task.voltage[:, k])
    return stretch.motion()


def refuse(plant: Plant, effects: Iterable[str]) -> None:
    """Refuse what a plant does not know.

    Raises:
        ConfigError: one of the effects, that it has not.
    """
    for effect in effects:
        why = plant.refuses(effect)
        if why:
            raise ConfigError(f"plant {plant.name} cannot hold the effect {effect}: {why}")


def refuse_laws(plant: Plant, task: PlantTask) -> None:
    """Refuse a world with other laws, for plants that have none but the usual ones.

    Raises:
        ConfigError: the task has other laws.
    """
    if not task.laws.usual:
        raise ConfigError(
            f"plant {plant.name} knows the usual laws only, not those of a world: use plant=numpy"
        )


def refuse_learned(plant: Plant, task: PlantTask) -> None:
    """Refuse a model with learned damping, for plants that have separate equations.

    Raises:
        ConfigError: there are damping subnetworks.
    """
    if getattr(task.model, "damping", None) is not None:
        raise ConfigError(
            f"plant {plant.name} cannot hold damping subnetworks: simulate a model without them, or use plant=own"
        )


def diverged(name: str, run: int, time: float, term: str) -> AuvnnError:
    """Return the error that says where a run left what is physical.

    Args:
        name: of the vehicle.
        run: its number.
        time: s.
        term: the force that was largest.
    """
    return AuvnnError(
        f"simulating {name}: run {run} diverged after {time:g} s; the largest term was {term}. Check its numbers"
    )
