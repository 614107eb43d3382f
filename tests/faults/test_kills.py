"""Two hundred SIGKILLs at random times: nothing half-written, former answers intact, what goes on ends bit-identical."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL and fork are POSIX")


@pytest.mark.long
def test_row_75_two_hundred_kills_leave_nothing_half_written():
    """In a separate process: it is forked, which one that has other threads must not be."""
    command = [sys.executable, "-m", "tests.faults.kills", "200"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=6 * 3600)
    assert done.returncode == 0, done.stderr[-3000:]
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["kills"] >= 198 and told["former"] > 60 and told["resumed"] >= 3
