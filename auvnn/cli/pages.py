"""`auvnn effects [NAME]` and `auvnn docs [PAGE]`: pages that only say something; they read no log and write nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from auvnn.errors import ConfigError


def effects(names: Sequence[str]) -> str:
    """Return one effect, all of them (`all`), or the list of their names and causes."""
    from auvnn.effects import EFFECTS
    from auvnn.effects.describe import describe_all, describe_effect

    if len(names) > 1:
        raise ConfigError(f"auvnn effects takes one name, not {len(names)}: {' '.join(names)}")
    if not names:
        width = max(map(len, EFFECTS.names()))
        listed = [f"  {name:<{width}}  {EFFECTS.get(name).cause}" for name in EFFECTS.names()]
        return "\n".join([*listed, "", "auvnn effects NAME says more of one, auvnn effects all of all."])
    if names[0] == "all":
        return describe_all([EFFECTS.get(name) for name in EFFECTS.names()]).rstrip("\n")
    return describe_effect(EFFECTS.get(names[0])).rstrip("\n")


def docs(names: Sequence[str]) -> str:
    """Return one page of the documentation, or the list of pages."""
    from auvnn.docs import page, page_names, title

    if len(names) > 1:
        raise ConfigError(f"auvnn docs takes one page, not {len(names)}: {' '.join(names)}")
    if names:
        return page(names[0]).rstrip("\n")
    width = max(map(len, page_names()))
    listed = [f"  {name:<{width}}  {title(name)}" for name in page_names()]
    return "\n".join([*listed, "", "auvnn docs PAGE shows one of them."])


def complete(words: Sequence[str]) -> str:
    """Return the completion script of a shell."""
    from auvnn.cli.completion import completion

    return completion(words)


PAGES: dict[str, Callable[[Sequence[str]], str]] = {
    "effects": effects,
    "docs": docs,
    "completion": complete,
}
