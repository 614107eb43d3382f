"""Which effects need another one beside them to do anything."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from auvnn.effects import effect_class


def needed_beside(name: str, beside: Iterable[str]) -> tuple[str, ...]:
    """Return the effects of which one is missing for an effect to do anything; empty where nothing is missing.

    Args:
        name: of the effect.
        beside: names of the effects that are there.

    Raises:
        ConfigError: there is no such effect.
    """
    needed = effect_class(name).acts_with
    return () if {*needed} & {*beside} else needed


def in_words(needed: Iterable[str]) -> str:
    """Return what is needed as words: "ocean_current, current_shear or waves"."""
    *others, last = needed
    return f"{', '.join(others)} or {last}" if others else last


def last_names(effects: Sequence[str]) -> list[str]:
    """Return the last effect of an explanation, and before it those that act beside it only and so came with it.

    Args:
        effects: of an explanation, in the order of the search.
    """
    return [*[n for n in effects[:-1] if effects[-1] in effect_class(n).acts_with], effects[-1]]


def in_order(effects: Sequence[str]) -> list[str]:
    """Return names in the order in which they are told: what acts beside others only comes after them.

    Args:
        effects: names that were found together.
    """
    return sorted(effects, key=lambda n: bool({*effect_class(n).acts_with} & {*effects}))


def in_place_of(name: str, effects: Sequence[str], rival: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the effects that go where a rival takes the place of one, and those that come.

    What acts beside the one only goes with it, unless something else is there beside which it acts; what acts beside the
    rival only comes with it.

    Args:
        name: of the effect that goes.
        effects: of the explanation that has it.
        rival: effects of an explanation whose last effect takes the place.
    """
    come = [e for e in last_names(rival) if e == rival[-1] or e not in effects]
    left = [e for e in (*effects, *come) if e != name]
    gone = [
        e for e in effects if e not in come and name in effect_class(e).acts_with and needed_beside(e, left)
    ]
    return [name, *gone], come
