"""Compiled code in the cache is run only if it is ours, private, whole, and what was written there."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from auvnn.compiled import disk_cache, toolchain
from auvnn.compiled.recorder import CannotCompile

SOURCE = "int answer(void) { return 42; }\n"
LANES = 1


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A private cache with the code of `SOURCE` in it."""
    monkeypatch.setenv("AUVNN_CACHE", str(tmp_path / "cache"))
    if toolchain.compiler() is None:
        pytest.skip("no C compiler")
    build()
    return tmp_path / "cache"


def build() -> float:
    loaded, seconds = toolchain.build(SOURCE, LANES)
    assert loaded.answer() == 42
    return seconds


def code(cache: Path) -> Path:
    (found,) = cache.glob("*.so")
    return found


def planted(folder: Path, marker: Path) -> Path:
    """Code that leaves a file when it is loaded."""
    text = f'#include <stdio.h>\n__attribute__((constructor)) void f(void) {{ fclose(fopen("{marker}", "w")); }}\n'
    (folder / "evil.c").write_text(text + "int answer(void) { return 13; }\n")
    compiler = toolchain.compiler()
    assert compiler
    subprocess.run([compiler, "-shared", "-fPIC", "-o", folder / "evil.so", folder / "evil.c"], check=True)
    return folder / "evil.so"


def test_sound_code_is_used_again(cache):
    assert build() == 0.0 and disk_cache.load(code(cache))
    assert {p.suffix for p in cache.iterdir()} == {".so", ".sha256"}


@pytest.mark.parametrize(
    "how", ["in place", "link", "hard link", "without hash", "loose", "loose hash", "owner"]
)
def test_what_was_planted_is_never_run(cache, tmp_path, monkeypatch, how):
    """As it lies there after somebody made a folder private into which others had written."""
    target, marker = code(cache), tmp_path / "ran"
    evil = planted(tmp_path, marker)
    target.unlink()
    digest = target.with_suffix(".sha256")
    if how == "link":
        target.symlink_to(evil)
    elif how == "hard link":
        os.link(evil, target)
    else:
        target.write_bytes(evil.read_bytes())
        target.chmod(0o700)
    if how != "in place":
        digest.write_text(hashlib.sha256(evil.read_bytes()).hexdigest())
    if how == "without hash":
        digest.unlink()
    if how == "loose":
        target.chmod(0o770)
    if how == "loose hash":
        digest.chmod(0o606)
    if how == "owner":
        monkeypatch.setattr(os, "getuid", lambda: 4711)
        assert disk_cache.load(target) is None and not disk_cache.looks_sound(target)
        return
    assert build() > 0.0
    assert not marker.exists() and disk_cache.load(target) and not target.is_symlink()


@pytest.mark.parametrize("share", [0.4])
def test_code_that_was_cut_short_is_made_again_and_never_ends_the_process(cache, share):
    target = code(cache)
    os.truncate(target, int(share * target.stat().st_size))
    words = "from auvnn.compiled import toolchain as t; import sys; lib, s = t.build(sys.argv[1], 1)\n"
    words += "sys.exit(0 if lib.answer() == 42 and s > 0 else 3)"
    done = subprocess.run([sys.executable, "-c", words, SOURCE], timeout=120)
    assert done.returncode == 0, "a signal is a negative status"


def test_a_flipped_bit_anywhere_is_seen(cache):
    target = code(cache)
    content = target.read_bytes()
    for place in range(0, len(content), max(1, len(content) // 200)):
        target.write_bytes(content[:place] + bytes([content[place] ^ 4]) + content[place + 1 :])
        assert disk_cache.load(target) is None
    target.write_bytes(content)
    assert disk_cache.load(target)


def test_a_kill_between_hash_and_code_costs_one_more_compilation(cache):
    code(cache).with_suffix(".sha256").write_text("0" * 64)
    assert build() > 0.0 and build() == 0.0


def test_folders_that_others_can_write_are_refused(cache, tmp_path):
    for place in (cache, tmp_path):
        mode = place.stat().st_mode
        place.chmod(0o777)
        with pytest.raises(CannotCompile, match="make it private"):
            build()
        place.chmod(mode)
    assert build() == 0.0


def test_a_folder_in_the_place_of_code_is_no_fault(cache):
    target = code(cache)
    target.unlink()
    target.mkdir()
    with pytest.raises(CannotCompile):
        build()


def test_a_compiler_that_lies_in_the_current_folder_is_not_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("cc", "gcc", "clang"):
        Path(name).write_text("#!/bin/sh\ntouch ran\n")
        Path(name).chmod(0o755)
    monkeypatch.delenv("AUVNN_CC", raising=False)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", f":.:{os.environ['PATH']}")
    found = toolchain.compiler()
    assert found is None or not Path(found).resolve().is_relative_to(tmp_path)


def test_code_in_use_cannot_be_cut_short(cache):
    words = "from auvnn.compiled import toolchain as t; import os, sys; lib, s = t.build(sys.argv[1], 1)\n"
    words += "os.truncate(sys.argv[2], 0); sys.exit(0 if lib.answer() == 42 and s == 0 else 3)"
    done = subprocess.run([sys.executable, "-c", words, SOURCE, str(code(cache))], timeout=120)
    assert done.returncode == 0, "a signal is a negative status"
    assert not [p for p in cache.iterdir() if p.name.startswith(".")]
