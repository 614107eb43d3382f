"""What an excitation is: options, and a plan of starts and commands for a number of runs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from auvnn.catalogue import Catalogue, unknown_name
from auvnn.errors import ConfigError
from auvnn.models import GreyBox

Array = NDArray[np.float64]


class Controller(Protocol):
    """Closes the loop: turns what the sensors report into commands, for all runs at once."""

    def __call__(self, k: int, position: Array, quaternion: Array, nu: Array) -> tuple[Array, Array | None]:
        """Return the commands (R, n) and fin angles (R, m) held from row k on.

        Args:
            k: row.
            position: measured, NED, m, (R, 3).
            quaternion: measured, (R, 4).
            nu: measured, (R, 6).
        """
        ...


@dataclass(frozen=True)
class Plan:
    """What R runs of T rows begin with and are told to do.

    Attributes:
        eta0: first position and attitude, (R, 7).
        nu0: first velocity, (R, 6), over ground, or through the water where `under_way`.
        command: thruster commands or wrench, (R, T, n); None where a controller makes them.
        fins: fin angles, rad, (R, T, m), or None.
        controller: makes the commands from measurements, or None in open loop.
        under_way: the vehicle starts in steady motion through the water, whatever the water does.
        notes: what had to be cut or changed, in words.
        set_points: what a controller is told to follow, by name, (R, T) each.
    """

    eta0: Array
    nu0: Array
    command: Array | None = None
    fins: Array | None = None
    controller: Controller | None = None
    under_way: bool = False
    notes: tuple[str, ...] = ()
    set_points: dict[str, Array] = field(default_factory=dict)


class Excitation(ABC):
    """A way of exciting a vehicle. A member is a frozen dataclass whose fields are its options.

    A plan is made from the model that the user has, never from the plant with its hidden effects: whoever
    drives the vehicle does not know them either. Run i takes all its random numbers from `generators[i]`,
    so that it stays what it is when more runs are asked for.
    """

    name: ClassVar[str]

    @abstractmethod
    def plan(self, model: GreyBox, t: Array, generators: Sequence[np.random.Generator]) -> Plan:
        """Return the plan of one run per generator, at the times t (T,), s.

        Args:
            model: nominal: nothing hidden is in it.
            t: times of the rows, s, (T,).
            generators: one for each run.
        """


def make_excitation(given: str | Mapping[str, Any], catalogue: Catalogue) -> Excitation:
    """Return the excitation that a name, or a mapping with `name` and options, asks for.

    Raises:
        ConfigError: unknown name or option, or a value of the wrong kind.
    """
    options: dict[str, Any] = {"name": given} if isinstance(given, str) else dict(given)
    if "name" not in options:
        raise ConfigError(f"excitation={options}: no name in it; there are: {', '.join(catalogue.names())}")
    name = str(options.pop("name"))
    member = catalogue.get(name)
    known = {f.name: f for f in fields(member)}
    for key, value in options.items():
        if key not in known:
            raise ConfigError(unknown_name(f"option of excitation {name}", key, known))
        options[key] = _fitting(f"excitation.{key}", value, known[key].default)
    return member(**options)


def _fitting(where: str, value: Any, default: Any) -> Any:
    """Return the value in the kind of the default."""
    if isinstance(default, (tuple, list)):
        if not isinstance(value, (tuple, list)) or len(value) != len(default):
            raise ConfigError(f"{where} = {value!r}: a list of {len(default)} numbers is needed")
        return tuple(_fitting(where, v, d) for v, d in zip(value, default, strict=True))
    number = isinstance(value, (int, float)) and not isinstance(value, bool) and np.isfinite(value)
    if isinstance(default, int) and number and float(value).is_integer():
        return int(value)
    if isinstance(default, float) and number:
        return float(value)
    kind = "whole number" if isinstance(default, int) else "number"
    raise ConfigError(f"{where} = {value!r}: a {kind} is needed")


def require(condition: bool, message: str) -> None:
    """Refuse an option.

    Raises:
        ConfigError: the condition does not hold.
    """
    if not condition:
        raise ConfigError(message)
