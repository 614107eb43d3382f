"""The words after the verb: Hydra's flags that we let through, and overrides."""

from __future__ import annotations

import difflib
from dataclasses import dataclass

from auvnn.errors import ConfigError

_SHOW = ("--help", "-h", "--hydra-help", "--cfg", "-c")
_PLAIN = ("--help", "-h", "--hydra-help", "--resolve", "--multirun", "-m", "--run", "-r")
_JOBS = ("--jobs", "-j")
_FOLDER = ("--config-dir", "-cd")
_VALUED = ("--cfg", "-c", "--package", "-p", "--config-dir", "-cd")


@dataclass(frozen=True)
class Words:
    """The command line of one verb.

    Attributes:
        flags: what Hydra is given as it stands; the folder of configs is not among them.
        overrides: words of the form key=value.
        shows: whether something is only to be shown.
        multirun: whether to run once for each value.
        config_dir: further folder of configs.
        jobs: processes at a time, each for a separate job; 0: as Hydra's launcher does it.
    """

    flags: list[str]
    overrides: list[str]
    shows: bool = False
    multirun: bool = False
    config_dir: str | None = None
    jobs: int = 0

    @classmethod
    def split(cls, arguments: list[str]) -> Words:
        """Tell flags from overrides.

        Hydra knows more flags than these; one of them loads a pickle, others put foreign configs in the
        place of ours.

        Raises:
            ConfigError: a flag is unknown or lacks its value.
        """
        flags: list[str] = []
        overrides: list[str] = []
        values: dict[str, str] = {}
        jobs = 0
        words = iter(arguments)
        for word in words:
            if not word.startswith("-"):
                overrides.append(word)
                continue
            flag, glued, value = word.partition("=")
            if flag in _JOBS:
                jobs = _number(flag, value if glued else next(words, ""))
                continue
            if flag in _VALUED:
                value = value if glued else next(words, "")
                if not value:
                    raise ConfigError(f"{flag} needs a value, such as --cfg job")
                if flag in _FOLDER:
                    if set(values) & set(_FOLDER):
                        raise ConfigError(f"{flag}: one folder of configs can be named, not two")
                else:
                    flags += [flag, value]
                values[flag] = value
            elif word in _PLAIN:
                flags.append(word)
            else:
                raise ConfigError(_unknown(word))
        multirun = "--multirun" in flags or "-m" in flags
        if jobs and not multirun:
            raise ConfigError(
                "-j runs many jobs at a time: it needs --multirun and a list, such as seed=0,1,2"
            )
        return cls(
            flags,
            overrides,
            shows=any(flag in _SHOW for flag in flags),
            multirun=multirun,
            config_dir=values.get("--config-dir", values.get("-cd")),
            jobs=jobs,
        )


def _number(flag: str, value: str) -> int:
    if not value.isdecimal() or int(value) < 1:
        raise ConfigError(f"{flag} needs a number of processes, such as {flag} 2")
    return int(value)


def _unknown(word: str) -> str:
    flags = sorted({*_PLAIN, *_VALUED, *_JOBS})
    near = difflib.get_close_matches(word, flags, n=1, cutoff=0.75)
    if near:
        return f"there is no flag {word}. Did you mean {near[0]}?"
    key, _, value = word.lstrip("-").replace("-", "_").partition("=")
    meant = f"options are written {key}={value or '...'}"
    return f"there is no flag {word}; {meant}, flags are {' '.join(flags)}"
