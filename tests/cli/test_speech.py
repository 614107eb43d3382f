"""Colour and progress are for a person at a terminal; files and pipes get plain lines."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from auvnn.cli.speech import Speaker, one_line
from auvnn.progress import Progress
from tests.cli.stand_ins import ENVIRONMENT

pty = pytest.importorskip("pty", reason="a terminal is needed")

SCRIPT = """
from auvnn.cli.speech import Speaker
say = Speaker()
say("name [with] brackets: " + "long " * 40, style="red")
say.progress("working")
say("done")
"""


def at_a_terminal(**environment: str) -> str:
    """Run the script with both streams on a terminal of 80 columns and return what appeared there."""
    ours, theirs = pty.openpty()
    keep = {k: v for k, v in ENVIRONMENT.items() if k not in ("NO_COLOR", "FORCE_COLOR", "TTY_COMPATIBLE")}
    process = subprocess.Popen(
        [sys.executable, "-c", SCRIPT],
        stdout=theirs,
        stderr=theirs,
        env={**keep, "TERM": "xterm", **environment},
    )
    os.close(theirs)
    shown = b""
    while True:
        try:
            piece = os.read(ours, 4096)
        except OSError:  # the other side has closed
            break
        if not piece:
            break
        shown += piece
    os.close(ours)
    assert process.wait() == 0, shown
    return shown.decode().replace("\r\n", "\n")


def test_colour_at_a_terminal():
    assert "\x1b[31m" in at_a_terminal()


def test_no_colour_when_that_is_asked_for():
    assert "\x1b[31m" not in at_a_terminal(NO_COLOR="1")


def test_lines_are_said_as_they_are_even_at_a_terminal():
    line = at_a_terminal(NO_COLOR="1").split("\n")[0]
    assert line.startswith("name [with] brackets:") and line.count("long") == 40


def test_progress_gives_way_to_the_next_line():
    shown = at_a_terminal(NO_COLOR="1")
    assert "working (0 s)\r\x1b[Kdone" in shown


def test_a_pipe_gets_plain_lines_and_no_progress(tmp_path: Path):
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, env=ENVIRONMENT)
    assert done.stderr == "" and "\x1b" not in done.stdout
    assert done.stdout.splitlines()[1] == "done"


def test_a_complaint_is_one_line_of_bounded_length():
    assert one_line("first\n  second\tthird") == "first second third"
    assert len(one_line("x" * 10_000)) == 600


class Clock:
    """Seconds that pass when told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def test_counted_work_tells_the_time_that_is_left(capsys):
    clock = Clock()
    say = Speaker(verbose=True, clock=clock)
    say.progress(Progress("fitting", 0, 4))
    clock.now += 30.0
    say.progress(Progress("fitting", 1, 4))
    lines = capsys.readouterr().err.splitlines()
    assert lines == [
        "progress  fitting (0 of 4 done, 0 s)",
        "progress  fitting (1 of 4 done, 30 s, about 1 min 30 s left)",
    ]


def test_redirected_progress_is_a_line_now_and_then(capsys):
    clock = Clock()
    say = Speaker(clock=clock)
    for _ in range(100):
        clock.now += 1.0
        say.progress("working")
    assert capsys.readouterr().err.splitlines() == [
        f"progress  working ({t})" for t in ("30 s", "1 min 00 s", "1 min 30 s")
    ]
    say("a line of its own")
    clock.now += 29.0
    say.progress("working")
    assert capsys.readouterr().err == ""


def test_json_alone_is_silent(capsys):
    Speaker(only_json=True, verbose=True).progress("working")
    assert capsys.readouterr() == ("", "")
