"""How a process ends when it is interrupted, killed, or not listened to."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.cli.stand_ins import ENVIRONMENT

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")

# `auvnn check`, whose work is to write a file, say so, and sleep.
SLEEPER = """
import sys, time
from auvnn.cli import check
from auvnn.cli.runs.job import Verb
from auvnn.cli.main import main

def run(job):
    (job.folder / "half.json").write_text("half")
    job.say("asleep")
    time.sleep(60)

check.VERB = Verb("sleep", ("log",), ("half.json",), run)
sys.exit(main())
"""


@pytest.fixture
def sleeper(tmp_path: Path):
    (tmp_path / "dive.csv").touch()
    processes = []

    def start(*arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, "-c", SLEEPER, "check", "log=dive.csv", "out=a/b", *arguments],
            cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=ENVIRONMENT,
        )  # fmt: skip
        processes.append(process)
        assert process.stdout is not None and process.stdout.readline() == "asleep\n"
        return process

    yield start
    for process in processes:
        process.kill()
        process.wait()


@pytest.mark.parametrize(("sent", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_run_says_so_in_one_line_and_leaves_nothing(sleeper, tmp_path, sent, status):
    process = sleeper()
    process.send_signal(sent)
    _, err = process.communicate(timeout=20)
    assert process.returncode == status
    assert err.count("\n") == 1 and "Traceback" not in err
    assert [p.name for p in tmp_path.iterdir()] == ["dive.csv"]


def test_a_killed_run_leaves_what_was_there_and_does_not_block_the_next(sleeper, tmp_path):
    (tmp_path / "a" / "b").mkdir(parents=True)
    (tmp_path / "a" / "b" / "half.json").write_text("whole")
    process = sleeper("overwrite=true")
    process.kill()
    process.wait()
    assert (tmp_path / "a" / "b" / "half.json").read_text() == "whole"
    again = sleeper("overwrite=true")
    assert again.poll() is None, "the lock fell with the process"


def test_a_second_run_into_the_same_folder_is_refused(sleeper, tmp_path):
    sleeper()
    command = [sys.executable, "-m", "auvnn", "check", "log=dive.csv", "out=a/b"]
    second = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=ENVIRONMENT)
    assert second.returncode == 2
    assert "another run is writing there" in second.stderr and second.stderr.count("\n") == 1


def test_nobody_listening_is_no_fault():
    process = subprocess.Popen(
        [sys.executable, "-m", "auvnn"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    )
    assert process.stdout is not None and process.stderr is not None
    process.stdout.close()
    time.sleep(0.01)
    assert process.wait(timeout=60) in (0, 141)
    assert process.stderr.read() == ""
