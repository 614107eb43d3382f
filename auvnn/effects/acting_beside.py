"""Which effects need another one beside them to do anything."""

from __future__ import annotations

from collections.abc import Iterable

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
