"""What is known of message types: which of their fields is what a log needs, in which unit and frame.

A new message type is a `Rule` in the file of its family, or a separate family: one file and one line here.
"""

from __future__ import annotations

from functools import lru_cache
from importlib import import_module

from auvnn.logs.mapping_rules.proposal import Proposal
from auvnn.logs.mapping_rules.proposal import propose as _propose
from auvnn.logs.mapping_rules.rule import Lie, Rule
from auvnn.logs.recording import Recording, Topic

__all__ = ["Proposal", "Rule", "lies", "propose"]

_FAMILIES = ("ros", "ardupilot", "mavlink", "px4", "imc", "moos", "slocum", "plain")


@lru_cache(maxsize=1)
def _all() -> tuple[tuple[Rule, ...], tuple[Lie, ...]]:
    rules: list[Rule] = []
    lies: list[Lie] = []
    for family in _FAMILIES:
        module = import_module(f"auvnn.logs.mapping_rules.{family}")
        rules += module.RULES
        lies += getattr(module, "LIES", ())
    return tuple(rules), tuple(lies)


def propose(recording: Recording, guesses: bool = False) -> Proposal:
    """Return the mapping that the known message types of a recording suggest.

    Args:
        recording: its topics, or the beginnings of them.
        guesses: whether fields of unknown messages are proposed too, by their names.
    """
    rules, _ = _all()
    return _propose(recording, [r for r in rules], lies, guesses)


def lies(topic: Topic) -> str:
    """Return why a topic must not be believed about its frame, "" where nothing is known against it."""
    return next((lie.words for lie in _all()[1] if lie.meets(topic)), "")
