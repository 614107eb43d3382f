"""The README tells the truth: it is short, its links and pictures are there, and its commands run as printed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from auvnn.cli.main import main

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def block(name: str) -> str:
    """Return the only code block between two marks."""
    found = re.findall(rf"<!-- {name} -->\n```\w+\n(.+?)\n```\n<!-- /{name} -->", README, re.DOTALL)
    assert len(found) == 1
    return found[0]


def test_it_is_read_in_three_minutes():
    assert len(README.encode()) <= 8000


def test_links_and_pictures_are_there():
    for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", README):
        assert re.match(r"https://", target) or (ROOT / target).exists(), target


def test_the_picture_is_small():
    assert (ROOT / "auvnn" / "docs" / "loop.svg").stat().st_size < 60_000


@pytest.mark.parametrize("what", ["demo", "tests"])
def test_there_is_one_command_for_each_beginning(what):
    command = block(what)
    assert "\n" not in command
    for path in re.findall(r"-c (\S+)", command):
        if path.startswith("."):
            assert (ROOT / path).exists()


def test_the_loop_runs_as_printed(tmp_path, monkeypatch, compiled_engine):
    monkeypatch.chdir(tmp_path)
    for line in block("loop").splitlines():
        assert main(shlex.split(line)[1:]) == 0, line
    exec(compile(block("python"), "README.md", "exec"), {})
    assert "ocean_current" in (tmp_path / "better-model" / "model.yaml").read_text()
    assert (tmp_path / "report.html").is_file()
