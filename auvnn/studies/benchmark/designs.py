"""Balanced designs: every effect at every cost, over vehicles, loops and variants, drawn by the effect's name."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from auvnn.errors import ConfigError
from auvnn.studies.benchmark.case import CLOSED, Case, apart

# A stream of random numbers that no log uses.
BALANCED = 204
# Manoeuvres by loop, where a part of a plan names none.
MANOEUVRES = {"open": "multisine", "closed": "survey"}


def balanced(
    names: Sequence[str],
    per_effect: int,
    costs: Sequence[float],
    vehicles: Sequence[str],
    loops: Sequence[str],
    variants: Sequence[Mapping[str, Any]],
    seed: int,
    can: Callable[[str, str], bool],
    shared: Mapping[str, Any],
    excitations: Sequence[str] = (),
) -> list[Case]:
    """Return so many logs per effect, each with another cost, vehicle, loop and variant as far as there are any.

    What an effect gets follows from its name and the seed alone: no log changes with what else is asked for. Logs with
    nothing hidden take vehicles, loops and variants in turn.

    Args:
        names: effects, or "nothing".
        per_effect: logs for each.
        costs: of the 5 s error, such as 0.15.
        vehicles: names.
        loops: "open" and "closed".
        variants: keys of a case, such as the rate or the world, that differ between logs.
        seed: of everything.
        can: whether an effect can be hidden in a vehicle.
        shared: every other key of the cases.
        excitations: manoeuvres; of each loop the first is taken.

    Raises:
        ConfigError: an effect can be hidden in none of the vehicles, or there are no costs.
    """
    manoeuvres = {
        loop: next((e for e in excitations if (e in CLOSED) == (loop == "closed")), MANOEUVRES[loop])
        for loop in loops
    }
    out = []
    for name in names:
        nothing = name == "nothing"
        if not nothing and not costs:
            raise ConfigError("balanced=: costs= is needed, such as costs=[0.15,0.4,1.5]")
        able = list(vehicles) if nothing else [v for v in vehicles if can(name, v)]
        if not able:
            raise ConfigError(f"{name} can be hidden in none of {', '.join(vehicles)}")
        key = 0 if nothing else zlib.crc32(name.encode())
        generator = np.random.default_rng(np.random.SeedSequence(int(seed), spawn_key=(BALANCED, key)))
        orders = [generator.permutation(len(x)) for x in (able, loops, variants, costs or [0.0])]
        first = seed + (0 if nothing else apart(name))
        for k in range(per_effect):
            # Of logs with nothing hidden, every combination in turn; of an effect's few, all kinds change at once.
            turns = (k, k // len(able), k // (len(able) * len(loops)), 0) if nothing else (k, k, k, k)
            at = [int(order[turn % len(order)]) for order, turn in zip(orders, turns, strict=True)]
            vehicle, loop, variant = able[at[0]], loops[at[1]], variants[at[2]]
            cost = costs[at[3]] if costs else 0.0
            size = "none" if nothing else f"{100.0 * float(cost):g}%"
            kind = "nothing" if nothing else "effect"
            own = {**shared, **variant}
            out.append(
                Case(
                    vehicle=vehicle,
                    hidden=name,
                    size=size,
                    excitation=manoeuvres[loop],
                    seed=first + k,
                    kind=kind,
                    **own,
                )
            )
    return out
