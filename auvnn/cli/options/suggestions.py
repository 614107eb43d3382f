"""What somebody may have meant: overrides mended and keys that are alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf

_KEYED = re.compile(r"([A-Za-z_][\w./@]*)=(.*)", re.DOTALL)


def mended(word: str) -> str:
    """Quote a value that Hydra's grammar cannot take as it stands, such as a path with brackets in it."""
    match = _KEYED.fullmatch(word)
    if match is None or match[2][:1] in ("'", '"', "{"):
        return word
    try:
        OverridesParser.create().parse_override(word)
    except (HydraException, RecursionError):
        plain_list = re.fullmatch(r"\[([^\[\]{}'\"]*)\]", match[2])
        if plain_list:
            return f"{match[1]}=[{','.join(quoted(item.strip()) for item in plain_list[1].split(','))}]"
        return word if match[2].startswith("[") else f"{match[1]}={quoted(match[2])}"
    return word


def quoted(value: object) -> str:
    """Return a text as Hydra's grammar takes it, whatever stands in it."""
    # Backslashes stand for themselves unless a quote follows, as in Hydra's grammar.
    escaped = re.sub(r"(\\*)('|$)", lambda m: m[1] * 2 + ("\\'" if m[2] else ""), str(value))
    return f"'{escaped}'"


def _wrong_kind(value: Any, default: Any) -> str | None:
    if isinstance(default, bool):
        return None if isinstance(value, bool) else "true or false is needed"
    if isinstance(default, int):
        good = isinstance(value, int) and not isinstance(value, bool)
        return None if good else "a whole number is needed"
    if isinstance(default, float):
        good = isinstance(value, (int, float)) and not isinstance(value, bool)
        return None if good else "a number is needed"
    if isinstance(default, str):
        return None if isinstance(value, str) else f"a word is needed, such as {default}"
    return None


def resolver_in(text: str) -> str | None:
    """Return the name of a resolver in a text, `oc.env` of `${oc.env:HOME}`; None where there is none.

    A name may itself be put together, as in `${oc.${x}:HOME}`: what stands inside is taken out first.
    """
    while True:
        match = re.search(r"\$\{\s*([\w.\s]*):", text)
        if match:
            return match[1].strip()
        inner = re.sub(r"\$\{[^{}:]*\}", "x", text)
        if inner == text:
            return None
        text = inner


def _first(override: Override) -> str:
    if override.is_sweep_override():
        return f"{override.get_key_element()}={next(iter(override.sweep_string_iterator()))}"
    return str(override.input_line)


def _heads(key: str) -> Iterator[str]:
    parts = key.split(".")
    return (".".join(parts[: n + 1]) for n in range(len(parts)))


def _paths(config: DictConfig, head: str = "") -> Iterator[str]:
    for key in config:
        path = f"{head}{key}"
        yield path
        if path == "hydra" or OmegaConf.is_missing(config, str(key)):
            continue
        if isinstance(config[key], DictConfig):
            yield from _paths(config[key], f"{path}.")


def _leaves(data: Any, path: tuple[str, ...] = ()) -> Iterable[tuple[tuple[str, ...], Any]]:
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _leaves(value, (*path, str(key)))
    elif isinstance(data, list):
        for value in data:
            yield from _leaves(value, path)
    elif path:
        yield path, data
