"""Completion is what the shells themselves say it is."""

from __future__ import annotations

import os
import pty
import select
import shutil
import subprocess
import time

import pytest
import yaml

from auvnn.cli.completion import FILES, completion, tables
from auvnn.cli.verbs import VERBS
from auvnn.config import config_dir
from auvnn.effects import EFFECTS
from auvnn.errors import ConfigError

BASH, ZSH, FISH = (shutil.which(name) for name in ("bash", "zsh", "fish"))


def bash(line: str, folder, breaks: str | None = None) -> list[str]:
    """Return what bash would offer for a line; with `breaks`, other characters end a word."""
    script = f"{completion(['bash'])}\n{'' if breaks is None else f'COMP_WORDBREAKS={breaks!r}'}\n"
    script += 'COMP_LINE="$1"; COMP_POINT=${#1}; _auvnn; printf "%s\\n" "${COMPREPLY[@]}"'
    done = subprocess.run(
        [str(BASH), "--norc", "-c", script, "bash", line],
        cwd=folder, capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    return [w for w in done.stdout.split("\n") if w]


@pytest.fixture
def folder(tmp_path):
    for name in ("dive.csv", "dive two.parquet", "other.csv"):
        (tmp_path / name).write_text("t\n")
    return tmp_path


@pytest.mark.skipif(BASH is None, reason="there is no bash")
def test_bash_completes_verbs_keys_and_values(folder):
    assert bash("auvnn comp", folder) == ["compare", "completion"]
    assert set(VERBS.names()) <= set(bash("auvnn ", folder))
    assert bash("auvnn simulate dur", folder) == ["duration="]
    assert bash("auvnn simulate noise=re", folder) == ["realistic"]
    assert bash("auvnn compare model=rov9", folder) == ["rov90", "rov95"]
    assert bash("auvnn add effect=[ocean_current,net_b", folder) == ["[ocean_current,net_buoyancy"]
    assert bash("auvnn effects surf", folder) == ["surface_proximity"]
    assert bash("auvnn compare log=dive", folder) == ["dive.csv", "dive two.parquet"]
    assert bash("auvnn compare --mul", folder) == ["--multirun"]
    assert bash("auvnn compare model=rov9", folder, breaks=" ") == ["model=rov90", "model=rov95"]
    assert bash("auvnn check model=nothing", folder) == []


def typed(program: str, words: list[str], keys: bytes, folder) -> str:
    """Return what a shell on a terminal shows, after somebody has typed `keys` there."""
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(folder)
        os.environ.update(INPUTRC="inputrc", TERM="dumb", HOME=str(folder), ZDOTDIR=str(folder))
        os.execv(program, [program, *words])
    said, end = "", time.monotonic() + 60
    try:
        # A line editor that starts throws away what was typed before it was there.
        while "ready> " not in said and time.monotonic() < end:
            if select.select([terminal], [], [], 1.0)[0]:
                said += os.read(terminal, 4096).decode("utf-8", "replace")
        os.write(terminal, keys)
        while "got: " not in said and time.monotonic() < end:
            if select.select([terminal], [], [], 1.0)[0]:
                said += os.read(terminal, 4096).decode("utf-8", "replace")
    finally:
        os.write(terminal, b"exit\n")
        os.close(terminal)
        os.waitpid(child, 0)
    return said


# Defined so that the line as it is typed does not hold what it prints.
SAYS = "auvnn() { printf 'g%s: %s\\n' ot \"$*\"; }"
KEYS = b"auvnn simul\tdurat\t12 noi\treal\t model=bluerov2_\t\n"
MEANT = "got: simulate duration=12 noise=realistic model=bluerov2_heavy"


@pytest.mark.skipif(BASH is None, reason="there is no bash")
def test_a_person_at_bash_presses_tab(folder):
    """Not the function alone: what readline writes into the line."""
    (folder / "rc").write_text(f"{completion(['bash'])}\nPS1='ready> '\n{SAYS}\n")
    (folder / "inputrc").write_text("set enable-bracketed-paste off\nset bell-style none\n")
    assert MEANT in typed(str(BASH), ["--noprofile", "--rcfile", "rc", "-i"], KEYS, folder)


@pytest.mark.skipif(ZSH is None, reason="there is no zsh")
def test_a_person_at_zsh_presses_tab(folder):
    (folder / ".zshrc").write_text(
        f"autoload -U compinit; compinit -u -D\n{completion(['zsh'])}\nPS1='ready> '\n{SAYS}\n"
    )
    assert MEANT in typed(str(ZSH), ["-o", "no_global_rcs", "-i"], KEYS, folder)


@pytest.mark.skipif(FISH is None, reason="there is no fish")
def test_fish_completes_the_same(folder):
    def fish(line: str) -> list[str]:
        script = f"{completion(['fish'])}\ncomplete -C '{line}'"
        done = subprocess.run(
            [str(FISH), "--no-config", "-c", script],
            cwd=folder, capture_output=True, text=True, timeout=60, check=True, env={**os.environ, "HOME": str(folder)},
        )  # fmt: skip
        return done.stdout.split("\n")[:-1]

    assert fish("auvnn comp") == ["compare", "completion"]
    assert fish("auvnn compare model=rov9") == ["model=rov90", "model=rov95"]
    assert fish("auvnn add effect=[ocean_current,net_b") == ["effect=[ocean_current,net_buoyancy"]
    assert fish("auvnn simulate dur") == ["duration="]


@pytest.mark.skipif(ZSH is None, reason="there is no zsh")
def test_zsh_reads_the_script_and_its_lists():
    made, asked = completion(["zsh"]), "_auvnn_values noise; echo $_comps[auvnn]"
    script = f"autoload -U compinit; compinit -u -D\n{made}\n{asked}"
    done = subprocess.run([str(ZSH), "-f", "-c", script], capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == ["none", "paper", "realistic", "_auvnn"], done.stderr


def test_the_lists_hold_every_key_of_every_verb():
    keys, values = tables()
    for verb in VERBS.names():
        data = yaml.safe_load((config_dir() / f"{verb}.yaml").read_text())
        own = {k for k in data if k not in ("hydra", "defaults")}
        assert own | {"out", "json"} <= set(keys[verb])
    assert values["effects"] == EFFECTS.names() and "rov95" in values["model"]
    assert not set(FILES) & set(values)


@pytest.mark.parametrize("words", [[], ["tcsh"], ["bash", "zsh"]])
def test_another_shell_is_refused(words):
    with pytest.raises(ConfigError, match="bash, zsh, fish"):
        completion(words)


def test_it_is_a_page_of_the_command(auvnn):
    status, out, err = auvnn("completion", "bash")
    assert (status, err) == (0, "") and "complete -o" in out
