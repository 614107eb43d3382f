"""YAML from a stranger: read as plain data, or refused in one line."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import auvnn.config
from auvnn.config import MAX_BYTES, config_dir, dump_yaml, parse_yaml, read_yaml, write_yaml
from auvnn.errors import AuvnnError, ConfigError, InputError

BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 10)
)


def test_scalars_are_those_of_yaml_1_2() -> None:
    text = (
        "a: no\nb: on\nc: 1e-3\nd: 010\ne: 12:30:00\nf: 2024-01-01\ng: 0x1F\nh: 1_000\n"
        "i: true\nj: False\nk: ~\nl:\nm: -.5\nn: '1.0'\no: +3\np: 6.e2\nq: .inf\nr: -.INF\ns: .\nt: a-\n"
    )
    data = parse_yaml(text, "x")
    assert data == {
        "a": "no", "b": "on", "c": 0.001, "d": 10, "e": "12:30:00", "f": "2024-01-01", "g": "0x1F",
        "h": "1_000", "i": True, "j": False, "k": None, "l": None, "m": -0.5, "n": "1.0", "o": 3, "p": 600.0,
        "q": math.inf, "r": -math.inf, "s": ".", "t": "a-",
    }  # fmt: skip
    assert isinstance(data["d"], int)
    assert isinstance(data["p"], float)
    assert math.isnan(parse_yaml("a: .NaN", "x")["a"])


REFUSED = {
    "alias bomb": (BOMB, InputError, ("line 2", "alias '*a0'", "write the value out")),
    "one alias": ("a: &x 1\nb: *x\n", InputError, ("alias '*x'",)),
    "merge": ("a: &x {b: 1}\nc: {<<: *x}\n", InputError, ("alias",)),
    "self reference": ("&x a: [*x]\n", InputError, ("alias",)),
    "deep": ("a: " + "[" * 40 + "]" * 40, InputError, ("32 levels", "flatten")),
    "very deep": ("a: " + "[" * 400_000, InputError, ("32 levels",)),
    "deep blocks": ("".join(" " * i + f"a{i}:\n" for i in range(60)), InputError, ("32 levels",)),
    "duplicate": ("mass: 1\nmass: 2\n", ConfigError, ("line 2", "'mass'", "twice")),
    "duplicate inside": ("a: {b: 1, b: 2}\n", ConfigError, ("'b'", "twice")),
    "number as key": ("3: 1\n", ConfigError, ("key 3", "quotes")),
    "list as key": ("? [a, b]\n: 1\n", ConfigError, ("not a word",)),
    "python object": ("a: !!python/object/apply:os.system ['true']\n", InputError, ("tag", "refused")),
    "python name": ("a: !!python/name:os.system\n", InputError, ("tag", "refused")),
    "own tag": ("a: !x 3\n", InputError, ("tag '!x'", "plain values")),
    "odd tag": ("a: !!map [1]\n", InputError, ("tag",)),
    "binary": ("a: !!binary aGk=\n", InputError, ("tag",)),
    "target": ("a: {_target_: os.system}\n", ConfigError, ("a: ", "'_target_'", "could name code")),
    "other hydra key": ("_partial_: true\n", ConfigError, ("'_partial_'",)),
    "dunder": ("__class__: x\n", ConfigError, ("'__class__'",)),
    "dotted": ("os.system: x\n", ConfigError, ("'os.system'", "could name code")),
    "target in a list": ("a: [{b: [{_target_: x}]}]\n", ConfigError, ("'_target_'",)),
    "environment": ("a: ${oc.env:HOME}\n", ConfigError, ("interpolation", "write the value itself")),
    "interpolation in a list": ("a: [1, 'x ${b} y']\n", ConfigError, ("interpolation",)),
    "interpolated key": ("'${a}': 1\n", ConfigError, ("interpolation",)),
    "empty": ("", InputError, ("is empty",)),
    "comment": ("# nothing\n", InputError, ("is empty",)),
    "list": ("- a\n- b\n", ConfigError, ("holds a list", "key: value")),
    "word": ("rov95", ConfigError, ("holds a str",)),
    "two documents": ("a: 1\n---\nb: 2\n", InputError, ("not plain YAML",)),
    "syntax": ("a: [1, 2\nb: 3\n", InputError, ("not plain YAML", "line 2")),
    "tab": ("a:\n\tb: 1\n", InputError, ("not plain YAML",)),
    "control character": ("a: \x07\n", InputError, ("not plain YAML",)),
    "endless integer": ("a: " + "9" * 10_000, InputError, ("cannot be read",)),
}


@pytest.mark.parametrize(("text", "kind", "words"), REFUSED.values(), ids=REFUSED)
def test_refused_in_one_line(
    text: str, kind: type[AuvnnError], words: tuple[str, ...], tmp_path: Path
) -> None:
    path = tmp_path / "given.yaml"
    path.write_text(text)
    with pytest.raises(kind) as refused:
        read_yaml(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert len(message) < 600
    for word in words:
        assert word in message


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    latin = tmp_path / "latin.yaml"
    latin.write_bytes("name: Sørensen\n".encode("latin-1"))
    large = tmp_path / "large.yaml"
    large.write_bytes(b"a: " + b"x" * MAX_BYTES)
    cases = {tmp_path / "no.yaml": "no such file", tmp_path: "is a folder", latin: "UTF-8",
             large: "larger than", Path("a\0b"): "cannot be read"}  # fmt: skip
    for path, words in cases.items():
        with pytest.raises(InputError, match=words):
            read_yaml(path)


def test_the_largest_allowed_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "just.yaml"
    path.write_bytes(b"a: " + b"x" * (MAX_BYTES - 3))
    assert len(read_yaml(path)["a"]) == MAX_BYTES - 3


def test_windows_text_is_read(tmp_path: Path) -> None:
    path = tmp_path / "windows.yaml"
    path.write_bytes("\ufeffname: Sørensen\r\nmass: 5\r\n".encode())
    assert read_yaml(path) == {"name": "Sørensen", "mass": 5}


def test_written_data_is_read_back_and_by_others_too(tmp_path: Path) -> None:
    data = {
        "matrix": [[1.0, 2.5e-7], [0.1, 1e22]],
        "tricky": ["no", "1e5", "0x1", "12:30", "~", "", " a", "a: b", "#", "🐟", "1.0", "true", "010"],
        "lines": "a\nb",
        "none": None, "yes": True, "n": 3,
    }  # fmt: skip
    path = write_yaml(tmp_path / "new" / "x.yaml", data)
    assert read_yaml(path) == data
    assert yaml.safe_load(path.read_text()) == data
    arrays = {"a": np.eye(2), "b": np.float32(0.5), "c": (1, 2), "d": np.int64(3), "e": np.bool_(True)}
    plain = {"a": [[1.0, 0.0], [0.0, 1.0]], "b": 0.5, "c": [1, 2], "d": 3, "e": True}
    assert read_yaml(write_yaml(path, arrays)) == plain


def test_shared_parts_are_written_out() -> None:
    shared = [1.0, 2.0]
    assert parse_yaml(dump_yaml({"a": shared, "b": shared}), "x") == {"a": shared, "b": shared}


@pytest.mark.parametrize(
    ("data", "words"),
    [
        ({"a": object()}, "a: a object cannot be written"),
        ({"a": {"b": {1, 2}}}, "set cannot be written"),
        ({3: 1}, "key 3"),
        ([1, 2], "only a mapping"),
        ({"_target_": "x"}, "could name code"),
        ({"a": "${b}"}, "interpolation"),
    ],
)
def test_what_would_not_be_read_is_not_written(data: Any, words: str, tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text("kept: 1\n")
    with pytest.raises(ConfigError, match=words):
        write_yaml(path, data)
    assert path.read_text() == "kept: 1\n"
    assert list(tmp_path.iterdir()) == [path]


KEYS = st.from_regex(r"[a-z][a-z0-9]{0,6}", fullmatch=True)
WORDS = st.text(st.characters(exclude_categories=["Cs", "Cc"]) | st.sampled_from("\n\t"), max_size=12)
PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats(allow_nan=False) | WORDS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(KEYS, inner, max_size=4),
    max_leaves=8,
)


@settings(max_examples=150, deadline=None)
@given(st.dictionaries(KEYS, PLAIN, min_size=1, max_size=3))
def test_plain_data_round_trips(data: dict[str, Any]) -> None:
    try:
        text = dump_yaml(data)
    except ConfigError as error:
        assert "interpolation" in str(error) or "could name code" in str(error)
        return
    assert parse_yaml(text, "x") == data


@settings(max_examples=400, deadline=None)
@given(
    st.text(st.sampled_from("ab:-?[]{},&*!|>'\"%@#~<. \n\t0129eE_$\\"), max_size=40) | st.text(max_size=40)
)
def test_any_text_is_read_or_refused_in_words(text: str) -> None:
    try:
        assert isinstance(parse_yaml(text, "x"), dict)
    except (InputError, ConfigError) as error:
        assert str(error).startswith("x: ")
        assert "\n" not in str(error)


def test_configs_are_looked_for_in_the_package_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "auvnn"
    beside, inside = tmp_path / "configs", package / "configs"
    package.mkdir()
    monkeypatch.setattr(auvnn.config, "__file__", str(package / "config.py"))
    beside.mkdir()
    with pytest.raises(ConfigError, match="reinstall"):
        config_dir()
    (beside / "vehicle").mkdir()
    assert config_dir() == beside
    (inside / "vehicle").mkdir(parents=True)
    assert config_dir() == inside


def test_our_own_files_are_readable() -> None:
    files = sorted((config_dir() / "vehicle").glob("*.yaml"))
    assert len(files) >= 5
    for path in files:
        assert read_yaml(path)["name"] == path.stem
