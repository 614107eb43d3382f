"""What was noted while reading is said once: the same of several files on one line, and mere notes by `check` alone."""

from __future__ import annotations

from pathlib import Path

from auvnn.cli.notes import noted, once
from auvnn.cli.runs.job import Job
from auvnn.logs.quality.finding import Finding
from auvnn.logs.reading.repairs.repair import Repair

FLIPS = "sign flips of the quaternion undone"


def test_the_same_repair_of_three_files_is_one_line_and_notes_are_counted():
    found = noted(
        [
            *(Repair(FLIPS, f"{n}.csv", count) for n, count in (("a", 8), ("b", 24), ("c", 1))),
            *(Repair("a row index left out", f"{n}.csv", 1, "info") for n in "abc"),
            Repair("time stamps repeated", "b.csv", 2, "warning"),
        ]
    )
    assert found == [
        ("repair", f"a.csv, b.csv and 1 more: {FLIPS} (8, 24, 1)"),
        ("warning", "b.csv: time stamps repeated (2)"),
        ("info", "1 note on how it was read: see auvnn check"),
    ]


def test_findings_with_counts_in_their_words_are_joined_and_different_ones_are_not():
    flips = [Finding("repair", f"{n}.csv", f"{FLIPS} ({count})", "") for n, count in (("a", 8), ("b", 24))]
    other = Finding("repair", "a.csv", "something else (8)", "")
    assert [words for _, words in once([*flips, other])] == [
        f"a.csv and b.csv: {FLIPS} (8, 24)",
        "a.csv: something else (8)",
    ]


def test_a_warning_is_said_once_in_a_command(capsys):
    job = Job({}, Path("out"), Path("out"))
    job.warn(["the centre of buoyancy lies low", "spikes"])
    job.warn(["spikes", "a third"])
    said = capsys.readouterr().out
    assert said.count("spikes") == 1 and "a third" in said and "centre of buoyancy" in said
