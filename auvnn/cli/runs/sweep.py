"""Many jobs of one verb: each a separate process with `-j N`, or by a launcher of Hydra's; how they ended.

A job that fails, is killed or cannot start is its own affair: the others go on, and the last line lists it. Where
launchers put jobs into other processes, each leaves its exit status in a small file, for the one who counts them.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser

from auvnn.answers import write_text
from auvnn.cli.faults import BAD_INPUT, FAULT
from auvnn.cli.options.suggestions import quoted
from auvnn.cli.runs.working import WORK, refuse_links, take_away
from auvnn.cli.speech import complain
from auvnn.errors import ConfigError
from auvnn.executors.safe_path import environment, python

_ENDED = "ended"


def jobs_of(overrides: Sequence[str]) -> list[list[str]]:
    """Return the overrides of each job of a sweep, in Hydra's own order."""
    parsed = OverridesParser.create().parse_overrides(list(overrides))
    return BasicSweeper.split_arguments(parsed, max_batch_size=None)[0]


def note(out: Path, number: int, status: int) -> None:
    """Leave a job's exit status where `statuses` finds it.

    Args:
        out: folder of all jobs.
        number: of the job.
        status: with which it ended.
    """
    write_text(out / WORK / _ENDED / str(number), str(status))


@contextlib.contextmanager
def statuses(out: Path, count: int) -> Iterator[list[int]]:
    """Give a list that holds, at the end, the exit status of each job; one that left none has failed."""
    place = out / WORK / _ENDED
    take_away(place)
    found: list[int] = []
    yield found
    for number in range(count):
        try:
            found.append(int((place / str(number)).read_text()))
        except (OSError, ValueError):
            found.append(FAULT)
    take_away(place)


def run_jobs(verb: str, flags: Sequence[str], overrides: Sequence[str], out: Path, workers: int) -> list[int]:
    """Run each job of a sweep as a separate process, several at a time, and return their exit statuses.

    Args:
        verb: name of the verb.
        flags: Hydra's, without those for many runs.
        overrides: of the sweep.
        out: folder; each job gets one below it, named by its number.
        workers: processes at a time.

    Raises:
        ConfigError: a launcher of Hydra's is named as well, or jobs are to be placed otherwise.
    """
    for word in overrides:
        key = word.partition("=")[0].lstrip("+")
        if key.startswith(("hydra/launcher", "hydra.launcher", "hydra/sweeper", "hydra.sweep")):
            raise ConfigError(f"{word}: -j runs the jobs itself; leave one of the two out")
    jobs = jobs_of(overrides)
    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(lambda n: _run_job(verb, n, [*flags, *jobs[n]], out), range(len(jobs))))


def _run_job(verb: str, number: int, words: Sequence[str], out: Path) -> int:
    try:
        refuse_links(out, out / str(number))
    except ConfigError as error:
        complain(f"auvnn {verb} (job {number}): {error}")
        return BAD_INPUT
    mine = [word for word in words if word.partition("=")[0] != "out"]
    done = subprocess.run(
        python("auvnn", verb, *mine, f"out={quoted(out / str(number))}"),
        capture_output=True,
        text=True,
        errors="replace",
        env={"OMP_NUM_THREADS": "1", **environment()},
        stdin=subprocess.DEVNULL,
    )
    label = f"auvnn {verb} (job {number})"
    # A job's lines are said together, so that those of several do not mix.
    sys.stdout.write(done.stdout)
    sys.stdout.flush()
    for line in done.stderr.splitlines():
        complain(line.replace(f"auvnn {verb}:", f"{label}:", 1))
    if done.returncode < 0:
        complain(
            f"{label}: killed by signal {-done.returncode}: not enough memory? Take fewer jobs at a time"
        )
        return FAULT
    return done.returncode
