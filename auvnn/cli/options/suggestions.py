"""What somebody may have meant: overrides corrected and keys that are alike."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf

from auvnn.config import config_dir
from auvnn.errors import one_line

_KEYED = re.compile(r"([A-Za-z_][\w./@]*)=(.*)", re.DOTALL)


def corrected(word: str) -> str:
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


# What the files of each key end in.
_ENDINGS = {
    "mapping": ("mapping.yaml", "mapping.yml", "map.yaml", "map.yml"),
    "model": (".yaml", ".yml"),
    "log": (".csv", ".parquet", ".mcap", ".bag", ".ulg", ".bin", ".tlog", ".h5", ".nc", ".mat", ".db3"),
}


def meant(verb: str, words: Sequence[str], bare: Sequence[str], known: Iterable[str]) -> str:
    """Return what somebody meant who left out the keys: the whole command with them, as far as they can be guessed.

    Args:
        verb: of the command.
        words: all of them.
        bare: those without a key.
        known: the verb's keys.
    """
    taken = {w.partition("=")[0] for w in words if "=" in w}
    free = [
        k
        for k in ("model", "log", "effect", "excitation", "case", "to", "file")
        if k in known and k not in taken
    ]
    guessed: dict[str, str] = {}
    for word in bare:
        key = _key_of(word, [k for k in (*free, "mapping") if k in known and k not in guessed.values()])
        if key is not None:
            guessed[word] = key
    said = ", ".join(f"'{one_line(w, 80)}'" for w in bare)
    wrong = f"{said} {'is' if len(bare) == 1 else 'are'} not of the form key=value"
    if len(guessed) < len(bare):
        return f"{wrong}; auvnn {verb} --help lists the keys"
    full = [w if w not in guessed else f"{guessed[w]}={one_line(w, 80)}" for w in words]
    return f"{wrong}; did you mean: auvnn {verb} {' '.join(full)}"


def _key_of(word: str, free: Sequence[str]) -> str | None:
    """Return the key whose value a word looks like: a vehicle, an effect, a model's folder, a log."""
    from auvnn.effects import EFFECTS

    lower = word.lower()
    vehicles = {path.stem for path in (config_dir() / "vehicle").glob("*.yaml")}
    if "model" in free and word in vehicles:
        return "model"
    if word in EFFECTS:
        return next((k for k in ("effect",) if k in free), None)
    for key, endings in _ENDINGS.items():
        if key in free and lower.endswith(endings):
            return key
    if "model" in free and (Path(word) / "model.yaml").is_file():
        return "model"
    for key in ("log", "model", "file"):
        if key in free and (key != "model" or difflib.get_close_matches(word, vehicles)):
            return key
    return None
