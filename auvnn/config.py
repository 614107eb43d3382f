"""Reading and writing YAML that may come from a stranger: plain data only, limited, and no code in it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from auvnn.answers import read_start, write_text
from auvnn.errors import ConfigError, InputError, one_line

MAX_BYTES = 1_000_000
MAX_DEPTH = 32

_Parser: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_MAP, _SEQ, _STR = (f"tag:yaml.org,2002:{kind}" for kind in ("map", "seq", "str"))
_NULL, _BOOL, _INT, _FLOAT = (f"tag:yaml.org,2002:{kind}" for kind in ("null", "bool", "int", "float"))

# YAML 1.2's core schema. YAML 1.1, PyYAML's own, reads `no` as false, `010` as 8 and `1e-3` as a string.
_SCALARS: tuple[tuple[str, str, list[str]], ...] = (
    (_NULL, r"^(~|null|Null|NULL|)$", [*"~nN", ""]),
    (_BOOL, r"^(true|True|TRUE|false|False|FALSE)$", [*"tTfF"]),
    (_INT, r"^[-+]?[0-9]+$", [*"-+0123456789"]),
    (
        _FLOAT,
        r"^([-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN))$",
        [*"-+.0123456789"],
    ),
)
_SPECIAL_KEY = re.compile(r"^_.*_$|^__")
_DOTTED_KEY = re.compile(r"^[A-Za-z_]\w*(\.[A-Za-z_]\w*)+$")


class _Loader(_Parser):
    """A loader that knows null, booleans, numbers, strings, lists and mappings, and nothing else."""

    yaml_implicit_resolvers: dict[Any, Any] = {}  # noqa: RUF012 - PyYAML's own way of configuring
    yaml_constructors: dict[Any, Any] = {}  # noqa: RUF012


class _Dumper(yaml.SafeDumper):
    """A dumper that quotes whatever our reader or a YAML 1.1 reader would not read as a string."""

    def ignore_aliases(self, data: Any) -> bool:
        """Write every value out: our reader refuses aliases."""
        return True


def _number(loader: Any, node: Any) -> int | float:
    text = loader.construct_scalar(node)
    if node.tag == _INT:
        return int(text)
    lowered = text.lower()
    return float(lowered.replace(".inf", "inf").replace(".nan", "nan"))


def _mapping(loader: Any, node: Any) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        line = key_node.start_mark.line + 1
        if not isinstance(key, str):
            raise ConfigError(f"line {line}: the key {key!r} is not a word; put it in quotes if it is meant")
        if key in result:
            raise ConfigError(f"line {line}: the key '{key}' stands there twice; keep one of them")
        result[key] = loader.construct_object(value_node, deep=True)
    return result


for _tag, _pattern, _first in _SCALARS:
    _Loader.add_implicit_resolver(_tag, re.compile(_pattern), _first)
    _Dumper.add_implicit_resolver(_tag, re.compile(_pattern), _first)
_Loader.add_constructor(_NULL, lambda loader, node: None)
_Loader.add_constructor(_BOOL, lambda loader, node: loader.construct_scalar(node).lower() == "true")
_Loader.add_constructor(_INT, _number)
_Loader.add_constructor(_FLOAT, _number)
_Loader.add_constructor(_STR, lambda loader, node: loader.construct_scalar(node))
_Loader.add_constructor(_SEQ, lambda loader, node: loader.construct_sequence(node, deep=True))
_Loader.add_constructor(_MAP, _mapping)


def config_dir() -> Path:
    """Return the folder of the shipped configurations: inside the package, else beside it.

    Raises:
        ConfigError: there is none, so the installation is broken.
    """
    package = Path(__file__).resolve().parent
    for folder in (package / "configs", package.parent / "configs"):
        # A stray top-level folder of the same name must not pass for ours.
        if (folder / "vehicle").is_dir():
            return folder
    raise ConfigError(f"no configs found in {package} or next to it; reinstall auvnn")


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Return the mapping in a YAML file, as plain data.

    Refused: more than 1 MB, more than 32 levels, aliases, duplicate keys, tags, keys that
    could name code (`_target_`, `os.system`) and `${...}` interpolation.

    Raises:
        InputError: the file cannot be read, is not YAML or is not safe to read.
        ConfigError: it is YAML, but says something that a data file must not say.
    """
    path = Path(path)
    raw = read_start(path, MAX_BYTES + 1, "is a folder, not a YAML file; name the file in it")
    if len(raw) > MAX_BYTES:
        raise InputError(f"{path}: is larger than {MAX_BYTES} bytes; ours hold a few kilobytes")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start}); save it as UTF-8") from None
    return parse_yaml(text, str(path))


def parse_yaml(text: str, where: str) -> dict[str, Any]:
    """Return the mapping in a YAML text under the rules of `read_yaml`; `where` names it in messages."""
    try:
        _limit(text, where)
        # The loader derives from a safe one and constructs nothing but plain data.
        data = yaml.load(text, Loader=_Loader)
    except yaml.YAMLError as error:
        raise InputError(f"{where}: is not plain YAML: {one_line(error, 300)}") from None
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None
    except InputError:
        raise
    except (ValueError, RecursionError, OverflowError) as error:
        raise InputError(f"{where}: holds a value that cannot be read: {one_line(error, 300)}") from None
    if data is None:
        raise InputError(f"{where}: is empty; it must hold `key: value` lines")
    if not isinstance(data, dict):
        raise ConfigError(f"{where}: holds a {type(data).__name__}; it must hold `key: value` lines")
    refuse_code(data, where)
    return data


def write_yaml(path: str | Path, data: dict[str, Any]) -> Path:
    """Write plain data (numpy arrays become lists) as YAML, beside its place and moved there.

    Raises:
        ConfigError: the data holds something that is not plain, or that `read_yaml` would refuse.
    """
    return write_text(Path(path), dump_yaml(data, str(path)))


def dump_yaml(data: dict[str, Any], where: str = "data") -> str:
    """Return plain data as the YAML text that `write_yaml` writes and `parse_yaml` gives back.

    Raises:
        ConfigError: as `write_yaml`.
    """
    plain = _plain(data, where)
    if not isinstance(plain, dict):
        raise ConfigError(f"{where}: only a mapping can be written, not a {type(data).__name__}")
    refuse_code(plain, where)
    return yaml.dump(
        plain, Dumper=_Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110
    )


def refuse_code(data: Any, where: str) -> None:
    """Refuse, anywhere in plain data, keys that could name code and strings to be interpolated.

    Raises:
        ConfigError: with the key and the place.
    """
    if isinstance(data, dict):
        for key, value in data.items():
            if _SPECIAL_KEY.match(key) or _DOTTED_KEY.match(key):
                raise ConfigError(f"{where}: the key '{key}' could name code and is refused; remove it")
            _refuse_interpolation(key, where)
            refuse_code(value, f"{where}: {key}")
    elif isinstance(data, list):
        for item in data:
            refuse_code(item, where)
    elif isinstance(data, str):
        _refuse_interpolation(data, where)


def _refuse_interpolation(text: str, where: str) -> None:
    if "${" in text:
        raise ConfigError(f"{where}: {text[:80]!r} asks for interpolation; write the value itself")


def _limit(text: str, where: str) -> None:
    depth = 0
    for event in yaml.parse(text, Loader=_Parser):
        if isinstance(event, yaml.AliasEvent):
            line = event.start_mark.line + 1
            raise InputError(
                f"{where}: line {line}: the alias '*{event.anchor}' is refused; write the value out"
            )
        if isinstance(event, (yaml.SequenceStartEvent, yaml.MappingStartEvent)):
            depth += 1
        elif isinstance(event, (yaml.SequenceEndEvent, yaml.MappingEndEvent)):
            depth -= 1
        # A tag asks for another type than the one that stands there, at worst for a Python object.
        tag = getattr(event, "tag", None)
        if tag is not None:
            line = event.start_mark.line + 1
            raise InputError(f"{where}: line {line}: the tag '{tag}' is refused; write plain values")
        if depth > MAX_DEPTH:
            raise InputError(f"{where}: is nested more than {MAX_DEPTH} levels deep; flatten it")


def _plain(value: Any, where: str) -> Any:
    if isinstance(value, np.ndarray):
        return _plain(value.tolist(), where)
    if isinstance(value, np.generic):
        return _plain(value.item(), where)
    if isinstance(value, dict):
        for key in value:
            if not isinstance(key, str):
                raise ConfigError(f"{where}: the key {key!r} is not a word")
        return {key: _plain(item, f"{where}: {key}") for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item, where) for item in value]
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise ConfigError(f"{where}: a {type(value).__name__} cannot be written as YAML; use plain data")
