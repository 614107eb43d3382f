"""The hidden-effect benchmark: hide, diagnose, count what was named, by effect, size, noise and manoeuvre.

`cases` lists the logs to make, by hand or by the balanced `designs` with hidden effects of stated `costs` and
`strangers`. `running` sends each through `one_log` on several processes, and the `journal` keeps the rows. `counts`
makes rates of them, `identifiability` says what was there to be seen, `falls` by how much the held-out error falls.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from auvnn.answers import plain
from auvnn.errors import InputError
from auvnn.progress import Progress
from auvnn.studies.benchmark.cases import NOTHING, Case, cases
from auvnn.studies.benchmark.counts.counting import false_names, in_group, named_first
from auvnn.studies.benchmark.counts.summary import Benchmark, summarise
from auvnn.studies.benchmark.journal import Journal
from auvnn.studies.benchmark.one_log import run_case
from auvnn.studies.benchmark.running import run_all

__all__ = [
    "NOTHING",
    "Benchmark",
    "Case",
    "benchmark",
    "cases",
    "false_names",
    "in_group",
    "named_first",
    "run_case",
    "summarise",
]


def benchmark(
    options: Mapping[str, Any],
    progress: Callable[[str], None] | None = None,
    *,
    journal: str | Path | None = None,
    any_code: bool = False,
    further: Sequence[str | Path] = (),
    only_done: bool = False,
) -> Benchmark:
    """Run all cases on several processes and count.

    Args:
        options: see `cases`; `workers` is how many processes, by default one for each core.
        progress: called after each log.
        journal: a file to which each row is added as it is done, and from which an interrupted run goes on.
        any_code: also go on from rows that another version of the code made.
        further: journals of other runs, on other machines perhaps, whose rows count as done here too.
        only_done: make no further log, and count those that are done.

    Raises:
        ConfigError: something in the options is unknown or out of range.
        InputError: a journal is none, or nothing is done that could be counted.
    """
    say = progress or (lambda words: None)
    todo = cases(options)
    kept = None if journal is None else Journal(journal)
    rows = {} if kept is None else kept.rows(todo, any_code=any_code)
    for path in further:
        if not Path(path).is_file():
            raise InputError(f"{path}: there is no such file of rows")
        for case, row in Journal(path).rows(todo, any_code=any_code).items():
            if case not in rows:
                rows[case] = row if kept is None else kept.append(row)
    if rows:
        say(Progress(f"going on: {len(rows)} of {len(todo)} logs are done", len(rows), len(todo)))
    left = [case for case in todo if case not in rows]
    if only_done:
        if not rows:
            raise InputError(
                "only_done: no log of this benchmark is done by this code (any_code=true: by any)"
            )
        answer = summarise([rows[case] for case in todo if case in rows], options)
        if left:
            answer.warnings.insert(0, f"{len(rows)} of {len(todo)} logs are done; the others are not counted")
        return answer
    workers = int(options.get("workers") or os.cpu_count() or 1)
    for row in run_all(left, workers, run_case):
        case = Case.of_row(row)
        rows[case] = plain(row) if kept is None else kept.append(row)
        words = (
            f"{row['hidden']} {row['size']} seed {row['seed']}: {row['verdict']} {'+'.join(row['missing'])}"
        )
        say(Progress(words, len(rows), len(todo)))
    return summarise([rows[case] for case in todo], options)
