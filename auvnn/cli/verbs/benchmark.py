"""`auvnn benchmark`: hide effects, diagnose, and count what was named."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from typing import Any

from auvnn.cli.runs.folder import WORK
from auvnn.cli.runs.job import Answering, Job, Verb

TAKEN = (
    "effects", "sizes", "noises", "excitations", "vehicles", "coefficients", "repeats", "seed", "runs", "duration",
    "rate", "workers", "plants", "accelerations", "loops", "pairs", "triples", "strangers", "held_out", "ties",
    "candidates", "only", "shift", "worlds", "balanced", "costs", "variants", "oracle", "without", "every",
    "offset",
)  # fmt: skip
JOURNAL = "rows.jsonl"


def _run(job: Job) -> Answering:
    from auvnn.studies.benchmark import benchmark

    options = {key: job[key] for key in TAKEN} | {"plan": job.options.get("plan")}
    # Not among the answer's files yet: those of a run that is interrupted are taken away.
    journal = job.out / WORK / JOURNAL
    try:
        answer = benchmark(
            options, job.say.progress, journal=journal, any_code=job["any_code"], further=_files(job["rows"]),
            only_done=job["only_done"],
        )  # fmt: skip
    except KeyboardInterrupt as end:
        raise type(end)(
            "the rows that are done are kept, and the same command goes on with the others"
        ) from None
    answer.write(job.folder)
    if journal.exists():
        shutil.copyfile(journal, job.folder / JOURNAL)
    for row in answer.table:
        verdicts = ", ".join(f"{k} {v}" for k, v in row["answers"].items())
        job.say(
            f"{row['hidden']:<19} {row['size']:<7} {row['noise']:<10} {row['excitation']:<10} "
            f"{row['named_first']} of {row['logs']} named first; {verdicts}"
        )
    data = answer.to_dict()
    job.warn(data["warnings"])
    for name, value in data["metrics"].items():
        job.say(f"result    {name} {_shown(value)}")
    for aim in data["targets"]:
        met = {None: "not measured", True: "met", False: "missed"}[aim["met"]]
        bounds = " ".join(f"{word} {aim[word]:g}" for word in ("least", "most") if aim[word] is not None)
        job.say(f"target    {aim['part']}: {aim['rate']} {_counted(aim)}, wanted {bounds}: {met}")
    return answer


def _files(given: Any) -> list[str]:
    """Return one file or several as a list."""
    return [] if given is None else [str(x) for x in ([given] if isinstance(given, str) else given)]


def _counted(aim: Mapping[str, Any]) -> str:
    """Return a rate as so many of so many, with its share; of a mean or median, over how many."""
    if aim["share"] is None:
        return "unknown"
    if aim["hits"] is None:
        return f"{_shown(aim['share'])} (over {aim['count']})"
    return f"{aim['hits']} of {aim['count']} ({100.0 * aim['share']:.3g} %)"


def _shown(value: Any) -> Any:
    return "unknown" if value is None else f"{value:.4g}" if isinstance(value, float) else value


VERB = Verb(
    summary="the hidden-effect benchmark: how often the right name is found, how often a wrong one",
    reads=(),
    writes=("benchmark.json", "rows.jsonl", "report.html", "figures/"),
    run=_run,
)
