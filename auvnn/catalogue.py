"""One explicit table per kind of pluggable thing: names to classes, imported only when asked for."""

from __future__ import annotations

import difflib
import importlib
from collections.abc import Iterable, Mapping
from importlib.metadata import entry_points
from typing import Any, TypeVar, cast

from auvnn.errors import ConfigError

T = TypeVar("T")


def unknown_name(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the one-line answer to an unknown name: what it might have been, and what there is."""
    names = sorted(known)
    near = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return f"no {kind} called '{name}'.{hint} There are: {', '.join(names)}"


def _origin(member: Any) -> tuple[str, str]:
    """Return where a class was written, by which the same one is known again after its cell has run again."""
    return str(getattr(member, "__module__", "")), str(getattr(member, "__qualname__", ""))


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
        self._added: dict[str, Any] = {}

    def register(self, name: str, member: Any) -> None:
        """Add a member at run time; one of the same origin is replaced, as when a notebook's cell runs again.

        Raises:
            ConfigError: another member has the name.
        """
        if name in self._added and _origin(self._added[name]) != _origin(member):
            raise ConfigError(f"there is another {self.kind} called '{name}': choose another name")
        if name not in self._added and name in self and self.get(name) is not member:
            raise ConfigError(f"{self.kind} '{name}' is in the catalogue already: choose another name")
        if name in self._added or name not in self:
            self._added[name] = member

    def _others(self) -> dict[str, Any]:
        if self._outside is None:
            found = {e.name: e for e in entry_points(group=self._group)}
            # A foreign package must not silently replace a member of the contract.
            self._outside = {name: e for name, e in found.items() if name not in self._table}
        return self._outside

    def names(self) -> list[str]:
        """Return the members' names, ours first, in the order of the table."""
        return [*self._table, *sorted(self._others()), *self._added]

    def __contains__(self, name: object) -> bool:
        """Say whether a member has this name."""
        return name in self._table or name in self._others() or name in self._added

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
        if name in self._added:
            return self._added[name]
        raise ConfigError(unknown_name(self.kind, name, self.names()))

    def build(self, description: str | Mapping[str, Any] | T, base: type[T], key: str, default: str) -> T:
        """Return a member built from its name or from `{key: name, <options>}`; one that is built already as it is.

        Args:
            description: what to build.
            base: what every member is; it states its options by `options()`.
            key: under which a mapping gives the name.
            default: the name where it gives none.

        Raises:
            ConfigError: an unknown member or option, or a value out of range.
        """
        if isinstance(description, base):
            return description
        options = (
            {key: description} if isinstance(description, str) else dict(cast(Mapping[str, Any], description))
        )
        kind = self.get(str(options.pop(key, default)))
        known = list(kind().options())
        for option in options:
            if option not in known:
                raise ConfigError(unknown_name(f"option of {self.kind} '{kind.name}'", str(option), known))
        return kind(**options)
