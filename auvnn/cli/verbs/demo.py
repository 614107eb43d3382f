"""`auvnn demo`: the whole way on a vehicle with a hidden ocean current."""

from __future__ import annotations

from auvnn.cli.runs.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.studies.demo import run_demo

    def tell(line: str) -> None:
        # It names the folder that it writes to, which is not yet where the user will find things.
        if str(job.folder) not in line:
            job.say(line)

    return run_demo(job.folder, job["seed"], tell)


VERB = Verb(
    summary="the whole way on a built-in vehicle with a hidden ocean current",
    reads=(),
    writes=("simulate/", "check/", "compare/", "diagnose/", "add/", "report.html", "figures/"),
    run=_run,
)
