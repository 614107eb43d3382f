"""Whatever the bytes of a recording: a log, or one line that says why not; no crash, no hang, no flood of memory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.logs.mutants import SAMPLES, read_all

ROOT = Path(__file__).parents[2]
NEEDS = {"mcap": "mcap_ros2", "db3": "rosbags", "bag": "rosbags", "ulog": "pyulog", "tlog": "pymavlink", "imc": "imcpy",
         "matlab-7.3": "h5py", "netcdf": "netCDF4"}  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("name", [n for n in SAMPLES if n not in ("matlab-7.3", "netcdf")])
def test_a_few_damaged_files(name: str) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    longest, _, _ = read_all(name, 12, seed=1)
    assert longest < 10.0


@pytest.mark.parametrize("name", ["matlab-7.3"])
def test_a_few_damaged_files_that_a_library_in_c_reads(name: str) -> None:
    pytest.importorskip("h5py")
    longest, _, _ = read_all(name, 2, seed=1)
    assert longest < 10.0


@pytest.mark.long
@pytest.mark.parametrize("name", SAMPLES)
def test_a_thousand_damaged_files(name: str) -> None:
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    command = [sys.executable, "-m", "tests.logs.mutants", name, "1000", "2"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=3000)
    assert done.returncode == 0, done.stderr[-2000:]
    longest, used, _ = map(float, done.stdout.split())
    assert longest < 10.0
    assert used < 1e9
