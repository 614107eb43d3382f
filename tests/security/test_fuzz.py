"""Whatever a stranger writes into a file that auvnn reads: a result or one line; no crash, no hang, no flood."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.security.fuzz import MAKERS, fuzz

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("kind", MAKERS)
def test_a_few_damaged_files(kind):
    longest, _, _ = fuzz(kind, 12, seed=1)
    assert longest < 10.0


@pytest.mark.long
@pytest.mark.parametrize("kind", MAKERS)
def test_a_thousand_damaged_files(kind):
    command = [sys.executable, "-m", "tests.security.fuzz", kind, "1000", "2"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=3000)
    assert done.returncode == 0, done.stderr[-2000:]
    longest, used, _ = map(float, done.stdout.split()[-3:])
    assert longest < 10.0
    assert used < 1e9
