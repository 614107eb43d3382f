"""`auvnn diagnose`: which physical effect is missing."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb, files
from auvnn.errors import ConfigError

if TYPE_CHECKING:
    from auvnn.diagnosis import Diagnosis

WORKERS = ("workers", "executor", "address")


def _run(job: Job) -> Answering:
    from auvnn.comparison.baseline import words
    from auvnn.logs.reading.portions import is_large

    in_parts = job["stream"]
    if in_parts is None:
        in_parts = job["max_duration"] is None and is_large(files(job.options, "log"))
    diagnosis = _in_parts(job) if in_parts else _in_memory(job)
    diagnosis.write(job.folder)
    data = diagnosis.to_dict()
    job.warn(data["warnings"])
    for line in words(diagnosis.baseline):
        job.say(f"baseline  {line}")
    for line in data["story"]:
        job.say(f"result    {line}")
    return diagnosis


def _in_memory(job: Job) -> Diagnosis:
    from auvnn.diagnosis import diagnose

    log = job.log(partial=True)
    options = {**_options(job, *WORKERS), "stochastic": bool(job["stochastic"])}
    return diagnose(job.model(log), log, _effects(job), progress=job.say.progress, **options)


def _in_parts(job: Job) -> Diagnosis:
    from auvnn.diagnosis.full_data.large_logs import diagnose_files
    from auvnn.logs.reading.portions import kinds_of

    if job["max_duration"] is not None:
        raise ConfigError("max_duration= reads the beginning of each file: leave it out, or say stream=false")
    paths, mapping = files(job.options, "log"), job.mapping()
    job.say(f"log       {len(paths)} files, read in parts by {job['workers']} workers")
    return diagnose_files(
        job.model(kinds=kinds_of(paths, mapping)), paths, _effects(job),
        mapping=mapping, progress=job.say.progress, **_options(job), **_shares(job),
    )  # fmt: skip


def _effects(job: Job) -> list[str] | None:
    return None if job["effects"] is None else job.names("effects")


def _options(job: Job, *more: str) -> dict[str, Any]:
    return {key: job[key] for key in ("max_effects", "window", "force", "tolerance", "costs", *more)}


def _shares(job: Job) -> dict[str, Any]:
    from auvnn.diagnosis.full_data.large_logs import LEADING, WINDOWS

    usual = {"windows": WINDOWS, "leading": LEADING}
    amounts = {k: {None: most, "all": None}.get(job[k], job[k]) for k, most in usual.items()}
    return {**amounts, **{key: job[key] for key in ("search", *WORKERS)}}


VERB = Verb(
    summary="which physical effect is missing, with its value and uncertainty",
    reads=("log", "mapping", "model"),
    writes=("diagnosis.json", "report.html", "figures/"),
    run=_run,
    dry_run=check_inputs,
)
