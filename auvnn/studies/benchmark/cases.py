"""Which logs a benchmark makes: every combination of its lists, or every part of a plan, each with its seed."""

from __future__ import annotations

import importlib
import importlib.util
import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from auvnn.catalogue import unknown_name
from auvnn.effects import EFFECTS
from auvnn.effects.acting_beside import in_words, needed_beside
from auvnn.errors import ConfigError
from auvnn.simulation.noise import make_noise
from auvnn.studies.benchmark.case import CLOSED, JOIN, KINDS, LOOPS, NOTHING, Case, apart
from auvnn.studies.benchmark.designs import balanced
from auvnn.studies.benchmark.strangers import stranger_names
from auvnn.vehicle import Vehicle, load_vehicle

# A stream of random numbers that no log uses: which effects are hidden together must not change their logs.
TOGETHER = 202
TRIES = 1000

# What may stand in a part of a plan, or beside it on the command line.
KEYS = (
    "effects", "sizes", "noises", "excitations", "vehicles", "coefficients", "repeats", "seed", "runs", "duration",
    "rate", "plants", "accelerations", "loops", "pairs", "triples", "strangers", "held_out", "ties", "candidates",
    "worlds", "balanced", "costs", "variants", "oracle", "without",
)  # fmt: skip
OF_A_PLAN = ("name", "common", "parts", "targets")


def cases(options: Mapping[str, Any]) -> list[Case]:
    """Return the logs that the options ask for.

    Args:
        options: lists or single values by name; see `KEYS` and `configs/benchmark.yaml`. With a `plan`, each of
            its parts is taken in turn, what it does not say being as in `common`, and then as in the options.
            Of every part (or of all combinations, without a plan) `every` and `offset` take a sample.

    Raises:
        ConfigError: something in it is unknown or out of range.
    """
    plan = options.get("plan")
    if plan is None:
        return _thinned(_combined(options, ""), options)
    for key in plan:
        if key not in OF_A_PLAN:
            raise ConfigError(unknown_name("key of a plan", str(key), OF_A_PLAN))
    common, parts = dict(plan.get("common") or {}), dict(plan.get("parts") or {})
    wanted = _several(options, "only") or list(parts)
    for name in wanted:
        if name not in parts:
            raise ConfigError(unknown_name("part of the plan", str(name), parts))
    out = []
    for name in parts:
        if name in wanted:
            given = {**common, **{k: v for k, v in (parts[name] or {}).items() if k != "targets"}}
            for key in given:
                if key not in KEYS:
                    raise ConfigError(unknown_name(f"key of the plan's part {name}", str(key), KEYS))
            # Each part begins elsewhere, so that a sample of them all holds different effects.
            begin = _count(options, "offset") + list(parts).index(name)
            out += _thinned(_combined({**options, **given}, str(name)), options, begin)
    return out


def _thinned(found: list[Case], options: Mapping[str, Any], begin: int | None = None) -> list[Case]:
    """Return every so many-th log, which keeps its seed and what is hidden in it, whatever is left out."""
    every, offset = _count(options, "every", 1), _count(options, "offset")
    if every < 1 or offset >= every:
        raise ConfigError(f"every={every} offset={offset}: offset= counts from 0 to every= less one")
    return found[(offset if begin is None else begin) % every :: every]


def targets(options: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return what a plan aims at: part ("all" for all of them), rate, and the least or most that it is to be."""
    plan = options.get("plan") or {}
    parts = plan.get("parts") or {}
    wanted = _several(options, "only") or list(parts)
    of = {str(n): (parts[n] or {}).get("targets") or [] for n in parts if n in wanted}
    of["all"] = plan.get("targets") or []
    return [{"part": part, **dict(target)} for part, aims in of.items() for target in aims]


def _several(options: Mapping[str, Any], key: str, default: Any = None) -> list[Any]:
    value = options.get(key, default)
    if value is None:
        return []
    return list(value) if isinstance(value, (list, tuple)) else [value]


def _count(options: Mapping[str, Any], key: str, default: int = 0) -> int:
    value = options.get(key)
    value = default if value is None else value
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < 0:
        raise ConfigError(f"{key}={value}: a whole number from 0 up is needed")
    return int(value)


def _combined(options: Mapping[str, Any], part: str) -> list[Case]:
    """Return every combination of the options' lists."""
    asked = _several(options, "effects")
    for name in asked:
        if name not in ("all", NOTHING):
            EFFECTS.get(name)
    strangers = stranger_names(_several(options, "strangers"))
    sizes = _several(options, "sizes")
    candidates = _several(options, "candidates")
    for name in candidates:
        EFFECTS.get(name)
    repeats, seed = _count(options, "repeats"), _count(options, "seed") + _count(options, "shift")
    out: list[Case] = []
    worlds = _several(options, "worlds") or [""]
    if _count(options, "balanced"):
        return _balanced(options, part, asked, candidates, worlds)
    for vehicle, plant, noise, excitation, accelerations, coefficients, world in itertools.product(
        _several(options, "vehicles"),
        _several(options, "plants", "own") or ["own"],
        _several(options, "noises"),
        _manoeuvres(options),
        _several(options, "accelerations") or [None],
        _several(options, "coefficients"),
        worlds,
    ):
        shared = dict(
            vehicle=vehicle, noise=noise, excitation=excitation, coefficients=str(coefficients), plant=str(plant),
            accelerations=accelerations, runs=int(options["runs"]), duration=float(options["duration"]),
            rate=float(options["rate"]), held_out=_count(options, "held_out"), ties=bool(options.get("ties")),
            candidates=tuple(candidates) or None, part=part, world=str(world), oracle=bool(options.get("oracle")),
            without=tuple(map(str, _several(options, "without"))),
        )  # fmt: skip
        names = _names(asked, load_vehicle(vehicle), noise, accelerations, str(plant))
        for hidden in names:
            nothing = hidden == NOTHING
            first = seed if nothing else seed + apart(hidden)
            for size, k in itertools.product(["none"] if nothing else sizes, range(repeats)):
                kind = "nothing" if nothing else "effect"
                out.append(Case(hidden=hidden, size=size, seed=first + k, kind=kind, **shared))
        for hidden, size, k in itertools.product(strangers, sizes, range(repeats)):
            first = seed + apart(hidden)
            out.append(Case(hidden=hidden, size=size, seed=first + k, kind="stranger", **shared))
        for count, key in ((2, "pairs"), (3, "triples")):
            for k in range(_count(options, key)):
                hidden, size = together([n for n in names if n != NOTHING], sizes, count, seed + k)
                out.append(Case(hidden=hidden, size=size, seed=seed + k, kind="several", **shared))
    return out


def _balanced(
    options: Mapping[str, Any],
    part: str,
    asked: Sequence[str],
    candidates: Sequence[str],
    worlds: Sequence[Any],
) -> list[Case]:
    """Return a part's logs where they are to be balanced: see `designs`."""
    plant, noise = (
        str((_several(options, k) or [d])[0]) for k, d in (("plants", "own"), ("noises", "realistic"))
    )
    accelerations = (_several(options, "accelerations") or [None])[0]
    shared = dict(
        noise=noise, coefficients=str(options["coefficients"]), plant=plant, accelerations=accelerations,
        runs=int(options["runs"]), duration=float(options["duration"]), rate=float(options["rate"]),
        held_out=_count(options, "held_out"), ties=bool(options.get("ties")), candidates=tuple(candidates) or None,
        part=part, world=str(worlds[0]), oracle=bool(options.get("oracle")),
        without=tuple(map(str, _several(options, "without"))),
    )  # fmt: skip
    variants = [dict(v) for v in _several(options, "variants")] or [{"world": str(w)} for w in worlds]
    for variant in variants:
        for key in variant:
            if key not in ("world", "rate", "excitation", "noise"):
                raise ConfigError(unknown_name("key of a variant", str(key), ("world", "rate", "noise")))
    vehicles = [str(v) for v in _several(options, "vehicles")]
    able = {v: set(can_be_hidden(load_vehicle(v), noise, accelerations, plant)) for v in vehicles}
    return balanced(
        asked, _count(options, "balanced"), [float(c) for c in _several(options, "costs")], vehicles,
        _several(options, "loops") or list(LOOPS), variants, _count(options, "seed") + _count(options, "shift"),
        lambda name, vehicle: name in able[vehicle], shared, [str(e) for e in _several(options, "excitations")],
    )  # fmt: skip


def _manoeuvres(options: Mapping[str, Any]) -> list[Any]:
    """Return the manoeuvres, chosen by loop where one is asked for."""
    given, loops = _several(options, "excitations"), _several(options, "loops")
    if not loops:
        return given
    out = []
    for loop in loops:
        if loop not in LOOPS:
            raise ConfigError(unknown_name("loop", str(loop), LOOPS))
        fitting = [e for e in given if (e in CLOSED) == (loop == "closed")]
        out += fitting or (["survey"] if loop == "closed" else ["multisine"])
    return list(dict.fromkeys(out))


def _names(
    asked: Sequence[str], vehicle: Vehicle, noise: Any, accelerations: bool | None, plant: str
) -> list[str]:
    """Return the names asked for; "all" are those of which a log of this kind can hold anything."""
    out: list[str] = []
    for name in asked:
        if name not in ("all", NOTHING) and (needed := needed_beside(name, ())):
            raise ConfigError(
                f"effects={name}: it does nothing without {in_words(needed)}, and cannot be hidden alone"
            )
        out += can_be_hidden(vehicle, noise, accelerations, plant) if name == "all" else [name]
    # Asked of every plant, so that one that is not there is refused before anything is run.
    refusing(plant)
    return list(dict.fromkeys(out))


def can_be_hidden(vehicle: Vehicle, noise: Any, accelerations: bool | None, plant: str = "own") -> list[str]:
    """Return the effects of the catalogue for which vehicle, plant and log have what they need, and that act alone.

    Args:
        vehicle: for its fins and its reference voltage.
        noise: condition: a name or its options.
        accelerations: whether they are measured; as the noise says where None.
        plant: what makes the motion.
    """
    actuation = "thrusters" if vehicle.thrusters else "wrench"
    measured = make_noise(noise).accelerations if accelerations is None else accelerations
    absent = set() if measured else {"du", "dv", "dw", "dp", "dq", "dr"}
    absent |= set() if vehicle.fins else {"fin_1"}
    absent |= {"voltage"} if vehicle.reference_voltage is None else set()
    kinds = {name: EFFECTS.get(name) for name in EFFECTS.names()}
    refused = refusing(plant)
    return [
        n
        for n, kind in kinds.items()
        if not kind.acts_with
        and not absent & set(kind.channels)
        and not kind.lacks(vehicle, actuation)
        and not refused(n)
    ]


def refusing(plant: str) -> Callable[[str], str]:
    """Return what says why a plant cannot hold an effect, or nothing.

    Raises:
        ConfigError: there is no such plant.
    """
    if plant == "own":
        return lambda effect: ""
    if importlib.util.find_spec("auvnn.plants") is None:
        raise ConfigError(
            f"plants={plant}: this installation has the package's own equations only; say plants=own"
        )
    return importlib.import_module("auvnn.plants").PLANTS.get(plant)().refuses


def together(names: Sequence[str], sizes: Sequence[str], count: int, seed: int) -> tuple[str, str]:
    """Return effects to be hidden together and the size of each, both joined by "+", as a seed draws them.

    Args:
        names: of the effects.
        sizes: of which one is drawn for each.
        count: how many are hidden together.
        seed: of the draw.

    Raises:
        ConfigError: there are not as many that go together.
    """
    generator = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(TOGETHER, count)))
    for _ in range(TRIES if len(names) >= count else 0):
        drawn = [str(n) for n in generator.choice(list(names), count, replace=False)]
        if not any(b in EFFECTS.get(a).excludes for a, b in itertools.permutations(drawn, 2)):
            chosen = [str(s) for s in generator.choice(list(sizes), count)]
            return JOIN.join(drawn), JOIN.join(chosen)
    raise ConfigError(f"effects={list(names)}: there are no {count} among them that can be hidden together")


__all__ = [
    "CLOSED",
    "JOIN",
    "KEYS",
    "KINDS",
    "LOOPS",
    "NOTHING",
    "Case",
    "apart",
    "cases",
    "targets",
    "together",
]
