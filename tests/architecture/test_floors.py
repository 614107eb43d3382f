"""The floors hold: the contracts of pyproject.toml, each shown to bite."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def lint(folder: Path, *contracts: str) -> subprocess.CompletedProcess[str]:
    # A process of its own: the linter looks at the package that is imported, which here is the real one.
    script = "from importlinter.cli import lint_imports_command as lint; lint()"
    limits = [word for contract in contracts for word in ("--contract", contract)]
    return subprocess.run(
        [sys.executable, "-c", script, "--no-cache", *limits],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)}, capture_output=True, text=True,
    )  # fmt: skip


def test_imports_only_go_down():
    done = lint(ROOT)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("contract", "path", "line"),
    [
        ("floors", "effects/added_mass.py", "import auvnn.models"),
        ("floors", "logs/log.py", "import auvnn.effects"),
        ("floors", "models/free_running/rollout.py", "import auvnn.report"),
        ("floors", "strange/__init__.py", ""),
        ("effects", "effects/added_mass.py", "import auvnn.effects.cg_offset"),
        ("plants", "plants/independent/equations.py", "import auvnn.physics.coriolis"),
        ("drawing", "models/free_running/rollout.py", "import matplotlib.pyplot"),
        ("hydra", "models/free_running/rollout.py", "import omegaconf"),
    ],
)
def test_each_contract_bites(tmp_path, contract, path, line):
    shutil.copytree(ROOT / "auvnn", tmp_path / "auvnn", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    broken = tmp_path / "auvnn" / path
    before = broken.read_text() if broken.exists() else ""
    assert lint(tmp_path, contract).returncode == 0, "the tree was whole before"
    broken.parent.mkdir(exist_ok=True)
    broken.write_text(f"{before}\n{line}\n")
    done = lint(tmp_path, contract)
    assert done.returncode == 1 and "BROKEN" in done.stdout, done.stdout + done.stderr


def test_every_contract_is_shown_to_bite():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    assert {c["id"] for c in contracts} == {"floors", "effects", "plants", "drawing", "hydra"}
