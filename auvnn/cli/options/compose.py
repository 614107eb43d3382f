"""Composing a verb's options with Hydra, and saying in one line what is wrong with them."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from auvnn.catalogue import unknown_name
from auvnn.cli.options.foreign import judge_hydra
from auvnn.cli.options.suggestions import (
    _first,
    _heads,
    _leaves,
    _paths,
    _wrong_kind,
    meant,
    quoted,
    resolver_in,
)
from auvnn.config import config_dir
from auvnn.errors import ConfigError, one_line

# Hydra's own parts are objects named in its configuration; nobody else's may be.
_CODE_KEYS = {"_target_", "_args_", "_partial_", "()", "class"}
_RESERVED = ("hydra.mode", "hydra.searchpath", "hydra.output_subdir", "hydra.run.dir", "hydra.sweep.dir")
_HYDRAS_OWN = ("hydra._internal.core_plugins.", "hydra_plugins.")


@lru_cache(maxsize=64)
def _own(verb: str, words: tuple[str, ...]) -> DictConfig:
    """Compose from the package's own configs alone, which stay as they are: once in a process; only to be read.

    Hydra takes a tenth of a second each time, and judging one command asks for the same more than once.
    """
    with initialize_config_dir(str(config_dir()), version_base="1.3"):
        config = compose(verb, list(words), return_hydra_config=True)
    OmegaConf.set_readonly(config, True)
    return config


class Composer:
    """Composes one verb's options.

    Args:
        verb: name of the verb and of its primary config.
        folder: further folder of configs: our own copy of what `read_configs` read.
        theirs: the folder that it was made from, for messages.
    """

    def __init__(self, verb: str, folder: str | Path | None = None, theirs: str = "--config-dir") -> None:
        """Compose the verb's defaults, against which overrides are judged."""
        self.verb, self.theirs = verb, theirs
        self.folder = Path(folder).absolute() if folder else None
        self.defaults = self._hydra([])
        self.known = {str(key) for key in self.defaults} - {"hydra"}
        choices = {str(g): c for g, c in self.defaults.hydra.runtime.choices.items()}
        self.groups = {g: self._members(g) for g in choices if "/" not in g}
        self.optional = {g for g in self.groups if choices[g] is None}

    def _hydra(self, words: list[str]) -> DictConfig:
        if self.folder is None:
            return _own(self.verb, tuple(words))
        search = f"hydra.searchpath=['file://{self.folder}']"
        with initialize_config_dir(str(config_dir()), version_base="1.3"):
            return compose(self.verb, [*words, search], return_hydra_config=True)

    def _members(self, group: str) -> list[str]:
        places = [config_dir(), *([self.folder] if self.folder else [])]
        return sorted({path.stem for place in places for path in (place / group).glob("*.yaml")})

    def checked(self, words: list[str], *, sweep: bool = False) -> list[str]:
        """Return the overrides as Hydra takes them, each one known to be read and to be meant.

        Raises:
            ConfigError: something is wrong with one of them; one line says what, and what was meant.
        """
        if bare := [w for w in words if "=" not in w and not w.startswith("~")]:
            raise ConfigError(meant(self.verb, words, bare, self.known))
        parsed = [o for o in map(self._parse, words) if not self._says_none(o)]
        for override in parsed:
            key, _, value = str(override.input_line).partition("=")
            if override.is_sweep_override() and key == "out":
                raise ConfigError(f"out={value}: each job gets a separate folder below one out=")
            if override.is_sweep_override() and not sweep:
                raise ConfigError(f"{key}={value}: write a list as {key}=[{value}], or add --multirun")
            if override.key_or_group in self.groups:
                self._check_member(override)
        groups = [_first(o) for o in parsed if o.key_or_group in self.groups]
        chosen = self._hydra(groups) if groups else self.defaults
        return [self._check_key(override, chosen) for override in parsed]

    def compose(self, checked: list[str]) -> DictConfig:
        """Return the composed options; of a sweep, those of its first job.

        Raises:
            ConfigError: they do not go together, or something in them could run code.
        """
        try:
            config = self._hydra([_first(OverridesParser.create().parse_override(word)) for word in checked])
        except (HydraException, OmegaConfBaseException, ValueError, RecursionError) as error:
            raise ConfigError(one_line(error)) from None
        self._judge(config)
        self._judge_hydra(config, checked)
        return config

    def judge_jobs(self, jobs: list[list[str]]) -> None:
        """Compose the jobs of a sweep that choose other configs of a user's folder, before the first of them starts.

        What words say themselves was judged as they were read, all values of a sweep among them.

        Raises:
            ConfigError: as `compose`.
        """
        seen: set[tuple[str, ...]] = set()
        for words in jobs if self.folder is not None else ():
            chosen = tuple(w for w in words if w.startswith("+") or re.split(r"[=@]", w)[0] in self.groups)
            if chosen not in seen:
                seen.add(chosen)
                self.compose(words)

    def _judge_hydra(self, config: DictConfig, words: list[str]) -> None:
        """Refuse what a user's folder makes of Hydra's own settings."""
        if self.folder is None:
            return
        said = [word for word in words if re.match(r"\+{0,2}hydra[./]", word)]
        named = {re.split(r"[=@]", word)[0].lstrip("+") for word in said}
        for group in ("hydra/launcher", "hydra/sweeper"):
            choice = config.hydra.runtime.choices.get(group)
            if choice and group not in named and choice != self.defaults.hydra.runtime.choices.get(group):
                said.append(f"{group}={quoted(choice)}")
        try:
            base = _own(self.verb, tuple(said))
        except (HydraException, OmegaConfBaseException) as error:
            raise ConfigError(one_line(error)) from None
        theirs, ours = (OmegaConf.to_container(c.hydra, resolve=False) for c in (config, base))
        judge_hydra(theirs, ours, self.theirs)

    def _parse(self, text: str) -> Override:
        word = one_line(text, 80)
        if word.startswith("~"):
            raise ConfigError(f"{word}: an option cannot be taken away; set it to null instead")
        if found := resolver_in(text):
            raise ConfigError(f"{word}: ${{{found}:...}} is refused; write the value itself")
        if any(key in text for key in ("_target_", "_args_", "_partial_")):
            raise ConfigError(f"{word}: options name members of catalogues, never Python code")
        key, _, value = text.partition("=")
        if ".." in key or (key.startswith("+") and ".." in re.split(r"[/'\"]", value)):
            raise ConfigError(f"{word}: leads out of the folder of configs; name one that is in it")
        if key in _RESERVED:
            raise ConfigError(f"{key} cannot be set; use out=, --multirun and --config-dir")
        try:
            return OverridesParser.create().parse_override(text)
        except (HydraException, RecursionError):
            raise ConfigError(
                f"'{word}' cannot be read; a value with special characters goes in quotes, {key}=\"'...'\", "
                f"a list is [a,b], a mapping '{{a: 1, b: 2}}'"
            ) from None

    def _says_none(self, override: Override) -> bool:
        """Say whether an optional group is set to null, which it is already and Hydra cannot be told."""
        return override.key_or_group in self.optional and override.value() is None

    def _check_member(self, override: Override) -> None:
        group = override.key_or_group
        swept = override.is_sweep_override()
        options = list(override.sweep_string_iterator()) if swept else [override.value()]
        for option in options if not isinstance(options[0], list) else options[0]:
            if option not in self.groups[group]:
                raise ConfigError(unknown_name(group, str(option), self.groups[group]))

    def _check_key(self, override: Override, chosen: DictConfig) -> str:
        key, word = override.key_or_group, str(override.input_line)
        if override.is_add() or key in self.groups or re.match(r"hydra[./]", key):
            return word
        paths = set(_paths(chosen)) - {"hydra"}
        if any(OmegaConf.select(chosen, head, default=None) == {} for head in _heads(key)):
            return f"++{word}"  # a mapping whose keys are the user's own
        for head in _heads(key):
            if head not in paths:
                raise ConfigError(self._unknown(head, paths))
        return word

    def _unknown(self, key: str, paths: Iterable[str]) -> str:
        everything = {*paths, *self.known, *self.groups}
        level = key.rpartition(".")[0]
        return unknown_name(
            "option", key, [p for p in everything if p.rpartition(".")[0] == level] or self.known
        )

    def _judge(self, config: DictConfig) -> None:
        for key in config:
            if str(key) not in {*self.known, *self.groups, "hydra"}:
                raise ConfigError(self._unknown(str(key), ()))
        for path, value in _leaves(OmegaConf.to_container(config, resolve=False)):
            if path[-1] in _CODE_KEYS and not str(value).startswith(_HYDRAS_OWN):
                raise ConfigError(f"{'.'.join(path)}: options name members of catalogues, never Python code")
            if found := resolver_in(str(value)):
                raise ConfigError(f"{'.'.join(path)}: ${{{found}:...}} is refused; write the value itself")

    def options(self, config: DictConfig) -> dict[str, Any]:
        """Return a composed job's options as plain data, of the kinds that the defaults show.

        Raises:
            ConfigError: an option is missing, or of another kind than its default.
        """
        try:
            missing = sorted(OmegaConf.missing_keys(config))
            if missing:
                raise ConfigError(f"{missing[0]}= is needed; auvnn {self.verb} --help shows how")
            plain = OmegaConf.to_container(config, resolve=True)
        except OmegaConfBaseException as error:
            raise ConfigError(one_line(error)) from None
        assert isinstance(plain, dict)
        options: dict[str, Any] = {str(key): value for key, value in plain.items() if key != "hydra"}
        for key, value in options.items():
            problem = _wrong_kind(value, OmegaConf.select(self.defaults, key, default=None))
            if problem:
                raise ConfigError(f"{key}={value}: {problem}")
        return options
