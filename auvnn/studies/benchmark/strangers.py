"""Hidden things that no name of the catalogue stands for: where a benchmark gets them from."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Sequence
from typing import Any

from auvnn.catalogue import unknown_name
from auvnn.errors import ConfigError

PLACE = "auvnn.plants.strangers"


def stranger_names(asked: Sequence[Any]) -> list[str]:
    """Return the strangers asked for, "all" being every one that there is.

    Raises:
        ConfigError: there is no such stranger.
    """
    if not asked:
        return []
    known = strangers()
    names = [n for a in asked for n in (known.names() if a == "all" else [str(a)])]
    for name in names:
        if name not in known:
            raise ConfigError(unknown_name("stranger", name, known.names()))
    return list(dict.fromkeys(names))


def strangers() -> Any:
    """Return the catalogue of strangers.

    Raises:
        ConfigError: the plants that can hold one are not installed.
    """
    if importlib.util.find_spec(PLACE.rpartition(".")[0]) is None or importlib.util.find_spec(PLACE) is None:
        raise ConfigError(
            "strangers=: this installation has no plants that can hold one; leave strangers= out"
        )
    return importlib.import_module(PLACE).STRANGERS
