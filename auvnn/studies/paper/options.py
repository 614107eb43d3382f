"""Options of a case study: read, checked, cut down for a smoke run, and reported as our assumptions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from auvnn.errors import ConfigError

EFFORTS = ("full", "smoke")
# A smoke run shows that everything works; its numbers mean nothing.
SMOKE_SCHEME = {"restarts": 1, "max_iterations": 40, "epochs": 40}
SMOKE_MOST = {
    "duration": 12.0, "rate": 10.0, "runs": 1, "iterations": 8, "restarts": 1, "best_of": 2, "larger": 6, "repeats": 1,
    "max_iterations": 40,
    "ahead": 2.0, "settle": 1.0,
}  # fmt: skip


@dataclass(frozen=True)
class Options:
    """What a study is asked for.

    Attributes:
        name: of the case.
        model: built-in vehicle, YAML file or model folder: the process plant model.
        seed: of everything that is drawn.
        rate: samples per second.
        duration: of the manoeuvre, s.
        step: longest step of the integrator, s.
        manoeuvre: the paper's: `force`, `moment`, `time`.
        damping: form of the six networks.
        scheme: by which they are trained.
        effort: "full" or "smoke".
        case: what the case alone takes.
    """

    name: str
    model: str
    seed: int
    rate: float
    duration: float
    step: float
    manoeuvre: dict[str, float]
    damping: dict[str, Any]
    scheme: dict[str, Any]
    effort: str
    case: dict[str, Any]

    @classmethod
    def read(cls, given: Mapping[str, Any]) -> Options:
        """Return the options, cut down where `effort` is "smoke".

        Raises:
            ConfigError: one is missing, or out of range.
        """
        case = dict(given.get("case") or {})
        name = case.pop("name", None)
        if not isinstance(name, str):
            raise ConfigError("case holds no name: choose noise_free, noisy or payload")
        effort = given["effort"]
        if effort not in EFFORTS:
            raise ConfigError(f"effort={effort!r}: choose full or smoke")
        if isinstance(given["seed"], bool) or not isinstance(given["seed"], int) or given["seed"] < 0:
            raise ConfigError(f"seed={given['seed']!r}: a whole number from 0 up is needed")
        plain = {k: given[k] for k in ("rate", "duration")}
        scheme = dict(given["scheme"])
        manoeuvre = {k: number(given["manoeuvre"][k], f"manoeuvre.{k}") for k in ("force", "moment", "time")}
        if effort == "smoke":
            plain, case = _cut(plain), _cut(case)
            scheme = {k: min(v, SMOKE_SCHEME[k]) if k in SMOKE_SCHEME else v for k, v in scheme.items()}
            manoeuvre["time"] = min(manoeuvre["time"], 7.0)
        return cls(
            name=name,
            model=str(given["model"]),
            seed=given["seed"],
            rate=number(plain["rate"], "rate", 0.5, 1000.0),
            duration=number(plain["duration"], "duration", 1.0, 1e5),
            step=number(given["step"], "step", 1e-4, 1.0),
            manoeuvre=manoeuvre,
            damping=dict(given["damping"]),
            scheme=scheme,
            effort=effort,
            case=case,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return all of them as plain data."""
        return dict(vars(self))

    def assumed(self) -> list[str]:
        """Return in words what the paper leaves open and these options decide, for all cases alike."""
        scheme = str(self.scheme.get("scheme")).replace("_", " ")
        return [
            f"ours: the vehicle is {self.model}; the paper publishes none of its matrices",
            f"ours: {self.rate:g} samples a second over {self.duration:g} s; the paper states neither",
            f"ours: networks trained by {scheme}, seed {self.seed}; the paper says back propagation",
            "ours: inputs and targets divided by their root mean square; the paper states no scaling",
            "the plant and the model are integrated by the same fourth-order Runge-Kutta steps of at most "
            f"{self.step:g} s",
        ]


def _cut(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values, none above what a smoke run takes."""
    out: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping):
            out[key] = _cut(value)
        elif key in SMOKE_MOST and isinstance(value, (int, float)) and not isinstance(value, bool):
            out[key] = type(value)(min(value, SMOKE_MOST[key]))
        else:
            out[key] = value
    return out


def number(value: Any, what: str, low: float = 0.0, high: float = 1e9) -> float:
    """Return a finite number within bounds.

    Args:
        value: what was given.
        what: its name, for the message.
        low: least value that is allowed.
        high: largest value that is allowed.

    Raises:
        ConfigError: it is none.
    """
    good = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
    if not good or not low <= value <= high:
        raise ConfigError(f"{what}={value!r}: a number from {low:g} to {high:g} is needed")
    return float(value)


def word(value: Any, what: str, known: tuple[str, ...]) -> str:
    """Return one of the known words.

    Args:
        value: what was given.
        what: its name, for the message.
        known: words that are allowed.

    Raises:
        ConfigError: it is none of them.
    """
    if value not in known:
        raise ConfigError(f"{what}={value!r}: choose {', '.join(known[:-1])} or {known[-1]}")
    return str(value)
