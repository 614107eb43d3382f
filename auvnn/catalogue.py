"""One explicit table per kind of pluggable thing: names to classes, imported only when asked for."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Iterable
from importlib.metadata import entry_points
from typing import Any

from auvnn.errors import ConfigError


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the one-line answer to an unknown name: what it might have been, and what there is."""
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"no {kind} called '{name}'.{hint} There are: {', '.join(names)}"


class Catalogue:
    """A table from names to classes, widened by entry points of other packages.

    Args:
        kind: what the members are, as a word for messages ("effect").
        table: name to "module:attribute", in the order in which they are listed.
        group: entry-point group by which other distributions add members.
    """

    def __init__(self, kind: str, table: dict[str, str], group: str) -> None:
        """Keep the table; nothing is imported yet."""
        self.kind = kind
        self._table = dict(table)
        self._group = group
        self._outside: dict[str, Any] | None = None

    def _others(self) -> dict[str, Any]:
        if self._outside is None:
            found = {e.name: e for e in entry_points(group=self._group)}
            # A foreign package must not silently replace a member of the contract.
            self._outside = {name: e for name, e in found.items() if name not in self._table}
        return self._outside

    def names(self) -> list[str]:
        """Return the members' names, ours first, in the order of the table."""
        return [*self._table, *sorted(self._others())]

    def __contains__(self, name: object) -> bool:
        """Say whether a member has this name."""
        return name in self._table or name in self._others()

    def get(self, name: str) -> Any:
        """Return the class called `name`.

        Raises:
            ConfigError: there is no such member; the message offers the nearest name.
        """
        if name in self._table:
            module, _, attribute = self._table[name].partition(":")
            return getattr(importlib.import_module(module), attribute)
        if name in self._others():
            return self._others()[name].load()
        raise ConfigError(unknown_name(self.kind, name, self.names()))
