"""What stands where: the top of the tree, one config per verb, and nothing that only one machine knows."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from auvnn.cli.main import VERBS

ROOT = Path(__file__).parents[2]
TOP = {"pyproject.toml", "auvnn", "configs", "experiments", "tests", "README.md"}
TEXT = {".py", ".md", ".yaml", ".toml", ".txt", ".json", ".html", ".j2", ".css", ".csv", ".sh", ""}

# Written in parts, so that this file does not contain what it forbids.
ELSEWHERE = re.compile(
    "|".join(
        [
            r"(?<![\w.])/" + r"(home|root|Users|work|opt|farm|mnt)/",
            r"/" + r"tmp/",
            r"[A-Z]:\\" + r"Users",
            r"\.lib" + r"rary/",
            r"(files\.python" + r"hosted|py" + r"pi)\.org",
            r"TO" + r"DO|FIX" + r"ME|NotImplemented" + r"Error",
        ]
    )
)


def tracked() -> list[Path]:
    """What is in the repository or would go into it."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    if listed.returncode != 0:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


def test_the_top_of_the_tree_is_exactly_what_the_readme_says():
    names = {path.relative_to(ROOT).parts[0] for path in tracked()}
    assert {name for name in names if not name.startswith(".")} == TOP


def test_no_file_knows_one_machine_or_is_unfinished():
    for path in tracked():
        if path.suffix in TEXT:
            for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
                assert not ELSEWHERE.search(line), f"{path.relative_to(ROOT)}:{number}: {line.strip()[:120]}"


def test_the_search_for_machine_paths_finds_them():
    for text in ("see /" + "home/ann/x", "in /" + "tmp/x", "# TO" + "DO later"):
        assert ELSEWHERE.search(text)
    assert not ELSEWHERE.search("position/velocity, m/s")


def test_every_verb_has_a_config_and_a_file_of_its_name():
    configs = {path.stem for path in (ROOT / "configs").glob("*.yaml")}
    assert configs == set(VERBS.names())
    for verb in VERBS.names():
        lines = (ROOT / "auvnn" / "cli" / "verbs" / f"{verb}.py").read_text().splitlines()
        assert len(lines) <= 80, f"{verb}.py is more than a thin layer"


def test_configs_name_members_and_never_code():
    for path in (ROOT / "configs").rglob("*.yaml"):
        assert "_target_" not in path.read_text(), path


def test_no_tracked_file_is_large():
    for path in tracked():
        assert path.stat().st_size < 2_000_000, f"{path.relative_to(ROOT)}: data is made by a command"
