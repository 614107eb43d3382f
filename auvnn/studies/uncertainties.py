"""Several uncertainties at once: which can be identified together, on which manoeuvre, and what stays confounded.

Damping, added mass and restoring are all badly known. For each manoeuvre of equal length the study works out

- what free running identifies: the information matrix of all parameters, the windows' initial states projected out,
  under the noise of good sensors. A parameter's standard error with everything else known, with all else
  uncertain too, and with damping not even of a known law but six networks, each against what was known before;
  what is correlated with what;
- what six networks of the velocity would absorb: the wrench by which each effect betrays itself along the
  motion, and the share of it that damping subnetworks can be trained to give.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvnn.answers import Answer, plain
from auvnn.errors import ConfigError
from auvnn.models import GreyBox, load
from auvnn.simulation import simulate
from auvnn.studies.identifiability import SWALLOWED, _listed, information, swallowed

Array = NDArray[np.float64]


@dataclass(repr=False)
class Uncertainties(Answer):
    """What each manoeuvre can tell of several uncertainties at once."""

    kind = "uncertainties"
    model: str
    prior: float
    seconds: float
    manoeuvres: dict[str, dict[str, Any]]
    metrics: dict[str, Any] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @property
    def story(self) -> list[str]:
        """The answer as a few plain sentences."""
        out = []
        for name, found in self.manoeuvres.items():
            count = len(found["parameters"])
            known = sum(p["verdict"] == "identified" for p in found["parameters"])
            mixed = sum(p["verdict"] == "confounded" for p in found["parameters"])
            out.append(
                f"{name}: {known} of {count} parameters are identified together, {mixed} more would be if the "
                "others were known"
            )
            free = [p for p in found["parameters"] if p["verdict_with_networks"] is not None]
            if free:
                left = sum(p["verdict_with_networks"] == "identified" for p in free)
                out[-1] += f"; with networks as damping {left} of the {len(free)} that are not damping"
            if found["swallowed"]:
                out.append(
                    f"{name}: networks of the velocity can be trained to give {_listed(found['swallowed'])}"
                )
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON answer."""
        names = ("model", "prior", "seconds", "manoeuvres", "metrics", "warnings", "story")
        return plain({"schema": "auvnn/uncertainties/1", **{n: getattr(self, n) for n in names}})


def uncertainties(
    model: str | GreyBox = "rov95",
    manoeuvres: Sequence[str] = ("paper", "multisine", "survey"),
    *,
    runs: int = 4,
    duration: float = 30.0,
    rate: float = 10.0,
    prior: float = 0.5,
    seed: int = 0,
    networks: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Uncertainties:
    """Say what each manoeuvre tells of damping, added mass and restoring when all three are uncertain.

    Args:
        model: a vehicle with its damping, as it really is.
        manoeuvres: names of excitations.
        runs: of each; the paper's input has no random part, so its runs are alike.
        duration: of each run, s.
        rate: samples per second.
        prior: relative standard deviation of every coefficient beforehand; buoyancy and centre of gravity are
            uncertain by their plausible scales.
        seed: of the manoeuvres and of the networks.
        networks: whether to train networks on each effect's trace as well, which takes most of the time.
        progress: called with what is being done, in words.

    Raises:
        ConfigError: an option is out of range.
    """
    say = progress or (lambda words: None)
    if not prior > 0:
        raise ConfigError(f"prior={prior!r}: give a positive relative standard deviation")
    vehicle = load(model) if isinstance(model, str) else model
    logs = {}
    for name in dict.fromkeys(manoeuvres):
        how = {"runs": runs, "duration": duration, "rate": rate, "max_step": 0.025}
        logs[name] = simulate(vehicle, name, "none", None, seed, **how).log
    found: dict[str, dict[str, Any]] = {}
    for name, log in logs.items():
        say(f"{name}: what free running identifies")
        found[name] = information(vehicle, log, prior, networks)
        shares: dict[str, Any] = {}
        if networks:
            # What was learned on the paper's single curve is compared with a motion that goes everywhere.
            other = logs.get("multisine") if name == "paper" else None
            for effect in SWALLOWED:
                if effect not in vehicle.effect_names:
                    say(f"{name}: training networks on the trace of {effect}")
                    shares[effect] = swallowed(vehicle, log, effect, seed, other)
        found[name]["swallowed"] = shares
    return Uncertainties(
        vehicle.vehicle.name, prior, runs * duration, found, _metrics(found), list(vehicle.vehicle.warnings)
    )


def _metrics(found: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for name, one in found.items():
        for verdict in ("identified", "confounded", "not excited"):
            key = f"{name}_{verdict.replace(' ', '_')}_parameters"
            out[key] = sum(p["verdict"] == verdict for p in one["parameters"])
        free = [
            p["verdict_with_networks"] for p in one["parameters"] if p["verdict_with_networks"] is not None
        ]
        if free:
            out[f"{name}_identified_beside_networks_parameters"] = free.count("identified")
        out[f"{name}_confounded_pairs"] = len(one["confounded_pairs"])
        out[f"{name}_condition_number"] = one["condition_number"]
        for effect, share in one["swallowed"].items():
            out[f"{name}_swallowed_share_{effect}"] = share["share"]
            out[f"{name}_swallowed_share_held_out_{effect}"] = share["held_out"]
    return out
