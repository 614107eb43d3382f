"""`auvnn fleet`: the same effects over many dives."""

from __future__ import annotations

from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb, files


def _run(job: Job) -> Answering:
    from auvnn.improvement import fleet
    from auvnn.logs.reading.portions import kinds_of

    paths, mapping = files(job.options, "log"), job.mapping()
    job.say(f"log       {len(paths)} dives")
    found = fleet(
        job.model(kinds=kinds_of(paths, mapping)), paths, job.names("effects"),
        mapping=mapping, progress=job.say.progress,
        **{key: job[key] for key in ("window", "windows", "force", "workers", "executor", "address")},
    )  # fmt: skip
    found.write(job.folder)
    for lost in found.failed:
        job.say(f"failed    {lost['file']}: {lost['words']}", style="yellow")
    job.warn(found.warnings)
    for row in found.trends:
        job.say(f"result    {row['words']}")
    return found


VERB = Verb(
    summary="the same effects over many dives: one table, a trend for each parameter, one plot",
    reads=("log", "mapping", "model"),
    writes=("fleet.json", "report.html", "figures/"),
    run=_run,
    dry_run=check_inputs,
)
