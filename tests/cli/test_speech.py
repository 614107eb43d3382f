"""Colour and progress are for a person at a terminal; files and pipes get plain lines."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import threading
import time
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
    say("a separate line")
    clock.now += 29.0
    say.progress("working")
    assert capsys.readouterr().err == ""


def test_json_alone_is_silent(capsys):
    Speaker(only_json=True, verbose=True).progress("working")
    assert capsys.readouterr() == ("", "")


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    def isatty(self):
        return True


def last_line(stream: Terminal) -> str:
    return stream.getvalue().rsplit("\r\x1b[K", 1)[-1]


def test_at_a_terminal_one_line_tells_what_is_done_and_to_come_and_the_time_left(monkeypatch):
    clock, terminal = Clock(), Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    say = Speaker(clock=clock)
    for done in range(3):
        say.progress(Progress("dive", done, 6))
        clock.now += 20.0
    assert last_line(terminal) == "dive (2 of 6 done, 40 s, about 1 min 20 s left)"
    assert "\n" not in terminal.getvalue()
    # Ten seconds of work inside the same step: what has passed of it is no longer to come.
    clock.now -= 10.0
    say.progress(Progress("dive", 2, 6))
    assert last_line(terminal) == "dive (2 of 6 done, 50 s, about 1 min 10 s left)"
    # The next work begins a separate count, without a guess from the one before.
    say.progress(Progress("weights", 0, 4, rough=True))
    assert last_line(terminal) == "weights (0 of about 4 done, 50 s)"


def test_more_steps_than_expected_keep_the_estimate(monkeypatch):
    clock, terminal = Clock(), Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    say = Speaker(clock=clock)
    for done, total in ((0, 4), (1, 4), (2, 4), (3, 6)):
        say.progress(Progress("search", done, total, rough=True))
        clock.now += 10.0
    assert last_line(terminal) == "search (3 of about 6 done, 30 s, about 30 s left)"


def test_silent_work_at_a_terminal_shows_that_it_goes_on(monkeypatch):
    clock, terminal = Clock(), Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    say = Speaker(clock=clock)
    say.sign()
    assert terminal.getvalue() == "", "short work needs no sign"
    clock.now += 3.0
    say.sign()
    assert last_line(terminal) == "working (3 s)"
    say.progress("fitting")
    clock.now += 1.5
    say.sign()
    assert last_line(terminal) == "fitting (4 s)"


def test_silent_work_that_is_redirected_says_a_line_now_and_then(capsys):
    clock = Clock()
    say = Speaker(clock=clock)
    say.progress(Progress("fitting", 1, 3))
    for _ in range(65):
        clock.now += 1.0
        say.sign()
    assert capsys.readouterr().err.splitlines() == [
        "progress  fitting (1 of 3 done, 30 s)",
        "progress  fitting (1 of 3 done, 1 min 00 s)",
    ]


def test_ticking_gives_signs_and_clears_its_line(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr("auvnn.cli.speech.SIGN", 0.01)
    monkeypatch.setattr("auvnn.cli.speech.SILENT", 0.02)
    say = Speaker()
    with say.ticking("comparing"):
        for _ in range(200):
            if "comparing" in terminal.getvalue():
                break
            time.sleep(0.02)
    shown = terminal.getvalue()
    assert "comparing (0 s)" in shown or "comparing (1 s)" in shown
    assert shown.endswith("\r\x1b[K")
    assert not any(t.name == "auvnn-progress" and t.is_alive() for t in threading.enumerate())
