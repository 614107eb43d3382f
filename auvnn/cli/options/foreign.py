"""A folder of configs that may come from a stranger: read as plain data, written out again, and only then composed.

Hydra reads YAML with another reader than ours, follows links and `..`, and does what stands below `hydra:` (set
environment variables, build objects by name). What it gets to see is therefore our own copy, which holds plain values
alone, and what composing it makes of `hydra:` is compared with what the command line alone makes of it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from auvnn.config import MAX_BYTES, dump_yaml, parse_yaml
from auvnn.errors import ConfigError

MOST_FILES, MOST_ENTRIES = 500, 20_000

# Plain numbers and names of launchers and sweepers. Not among them: what is run in a shell (setup, srun_args,
# additional_parameters), addresses, paths, and the sweeper's own overrides.
PLAIN = {
    "hydra.launcher": {
        # joblib
        "n_jobs", "backend", "prefer", "require", "verbose", "timeout", "batch_size",
        # submitit
        "timeout_min", "cpus_per_task", "gpus_per_node", "tasks_per_node", "mem_gb", "nodes", "name", "partition", "qos",
        "comment", "constraint", "exclude", "gres", "cpus_per_gpu", "gpus_per_task", "mem_per_gpu", "mem_per_cpu",
        "account", "max_num_timeout", "array_parallelism", "stderr_to_stdout", "signal_delay_s",
        # ray
        "ray.init.num_cpus", "ray.init.num_gpus", "ray.remote.num_cpus", "ray.remote.num_gpus", "ray.remote.max_retries",
    },
    "hydra.sweeper": {
        "max_batch_size", "n_trials", "n_jobs", "direction", "max_failure_rate", "study_name", "sampler.seed",
    },
}  # fmt: skip
# What Hydra itself notes there while it composes.
_NOTED = re.compile(r"hydra\.(runtime|overrides|searchpath|job\.(override_dirname|config_name))(\.|$)")
_CHOSEN = ("hydra/launcher", "hydra/sweeper")
_HEADER = re.compile(r"^\s*#\s*@\s*package\s+(\S+)\s*$")


def read_configs(folder: Path) -> dict[str, str]:
    """Return the configs in a folder and below it as YAML text that holds plain values, by their relative paths.

    Raises:
        ConfigError: a file or what it says is refused, or there is too much of it.
        InputError: a file cannot be read as plain YAML.
    """
    return {name: _plain_text(folder / name) for name in _names(folder)}


def write_configs(configs: Mapping[str, str], folder: Path) -> Path:
    """Write what `read_configs` returned into a folder."""
    for name, text in configs.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder


def _names(folder: Path) -> list[str]:
    found: list[str] = []
    entries = 0
    for place, folders, files in os.walk(folder):
        here = Path(place)
        entries += len(folders) + len(files)
        if entries > MOST_ENTRIES:
            raise ConfigError(
                f"--config-dir {folder}: holds more than {MOST_ENTRIES} files; name a folder of configs"
            )
        for name in folders:
            if (here / name).is_symlink():
                raise ConfigError(f"{here / name}: is a link to a folder, and none is followed; copy it")
        if here == folder and "hydra" in folders:
            raise ConfigError(f"{here / 'hydra'}: configs for Hydra itself are refused; remove that folder")
        found += [str((here / name).relative_to(folder)) for name in files if name.endswith(".yaml")]
        if len(found) > MOST_FILES:
            raise ConfigError(
                f"--config-dir {folder}: holds more than {MOST_FILES} configs; name a smaller folder"
            )
    return sorted(found)


def _plain_text(path: Path) -> str:
    if not path.is_file():
        raise ConfigError(f"{path}: is no plain file; remove it")
    with path.open("rb") as stream:
        raw = stream.read(MAX_BYTES + 1)
    if len(raw) > MAX_BYTES:
        raise ConfigError(f"{path}: is larger than {MAX_BYTES} bytes; a config holds a few kilobytes")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ConfigError(f"{path}: is not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    header = _header(text, path)
    if not _says_something(text):
        return header
    data = parse_yaml(text, str(path))
    _judge_defaults(data.get("defaults"), path)
    if "hydra" in data:
        _judge_hydra_key(data["hydra"], path)
    return header + dump_yaml(data, str(path))


def _says_something(text: str) -> bool:
    return any(line.strip() and not line.lstrip().startswith("#") for line in text.splitlines())


def _header(text: str, path: Path) -> str:
    for line in text.splitlines():
        if not line.strip():
            continue
        if not line.lstrip().startswith("#"):
            break
        match = _HEADER.match(line)
        if match is None and re.match(r"\s*#\s*@", line):
            raise ConfigError(f"{path}: the line '{line.strip()[:60]}' is refused; write '# @package NAME'")
        if match:
            if match[1].split(".")[0] == "hydra" or not re.fullmatch(r"[A-Za-z_][\w.]*", match[1]):
                raise ConfigError(
                    f"{path}: the package '{match[1][:60]}' is refused; write to options of auvnn"
                )
            return f"# @package {match[1]}\n"
    return ""


def _judge_defaults(entries: Any, path: Path) -> None:
    """Refuse, in a list of defaults, whatever leads out of the folder or to another part of Hydra than launchers."""
    for entry in entries if isinstance(entries, list) else []:
        words = (
            [str(w) for w in (*entry.keys(), *entry.values())] if isinstance(entry, dict) else [str(entry)]
        )
        for word in words:
            if ".." in word.split("@")[0].split("/"):
                raise ConfigError(f"{path}: defaults: '{word}' leads out of the folder; name configs in it")
            group = word.removeprefix("override ").removeprefix("optional ").strip().lstrip("/")
            if (
                (re.match(r"hydra(/|$)", group) and group not in _CHOSEN)
                or "@hydra" in group
                or ".hydra" in group
            ):
                raise ConfigError(
                    f"{path}: defaults: '{word}' is refused; only {' and '.join(_CHOSEN)} can be chosen"
                )


def _judge_hydra_key(said: Any, path: Path) -> None:
    for name, value in leaves(said, "hydra"):
        if not is_plain_parameter(name, value):
            raise ConfigError(f"{path}: {name} is refused; of hydra only {_allowed()} can be set here")


def is_plain_parameter(name: str, value: Any) -> bool:
    """Say whether a dotted name is one of the plain parameters of a launcher or a sweeper, with a plain value.

    Some end up in a script for a queue: a text with a line break in it would be a command there.
    """
    if not (
        value is None
        or isinstance(value, (bool, int, float))
        or re.fullmatch(r"[A-Za-z0-9][\w.:,+-]*", str(value))
    ):
        return False
    return any(
        name.startswith(f"{part}.") and name[len(part) + 1 :] in names for part, names in PLAIN.items()
    )


def judge_hydra(composed: Any, base: Any, where: str) -> None:
    """Refuse composed settings of Hydra that differ from what the command line alone gives, plain parameters aside.

    Args:
        composed: the node `hydra` with the folder's configs, as plain data.
        base: the same without them.
        where: the folder, for the message.

    Raises:
        ConfigError: naming the setting.
    """
    before, after = dict(leaves(base, "hydra")), dict(leaves(composed, "hydra"))
    for name in [*after, *(n for n in before if n not in after)]:
        same = name in before and name in after and before[name] == after[name]
        if not same and not _NOTED.match(name) and not is_plain_parameter(name, after.get(name)):
            raise ConfigError(
                f"{where}: sets {name}, which is refused; of hydra only {_allowed()} can be set there"
            )


def _allowed() -> str:
    return "n_jobs, timeout_min and other plain parameters of hydra.launcher and hydra.sweeper"


def leaves(data: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Yield the values in nested mappings by their dotted names; a list, or an empty mapping, is one value."""
    if isinstance(data, dict) and data:
        for key, value in data.items():
            yield from leaves(value, f"{path}.{key}")
    else:
        yield path, data


__all__ = ["judge_hydra", "leaves", "read_configs", "write_configs"]
