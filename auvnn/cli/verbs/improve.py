"""`auvnn improve`: the whole loop in one command."""

from __future__ import annotations

from auvnn.cli.runs.dry import check_inputs
from auvnn.cli.runs.job import Answering, Job, Verb
from auvnn.errors import ConfigError


def _run(job: Job) -> Answering:
    from auvnn.improvement import improve
    from auvnn.improvement.loop.learned import KINDS

    log, test, say = job.log(), job.held_out(), job.say
    learn = (
        KINDS if job["learn"] is None else job["learn"] if isinstance(job["learn"], list) else [job["learn"]]
    )
    for key in ("max_effects", "seconds"):
        if isinstance(job[key], bool) or not isinstance(job[key], (int, float)) or job[key] <= 0:
            raise ConfigError(f"{key}={job[key]} must be a number above zero")
    found = improve(
        job.model(log), log,
        test=test, effects=None if job["effects"] is None else job.names("effects"), learn=learn,
        max_effects=int(job["max_effects"]), seconds=float(job["seconds"]), diagnosing=bool(job["diagnosing"]),
        derivative=job["derivative"], force=job["force"],
        progress=say.progress, tell=lambda words: say(f"story     {words}"),
    )  # fmt: skip
    found.write(job.folder)
    data = found.to_dict()
    say(f"{'assumed' if test is None else 'test':<9} {data['held_out']}")
    job.warn(data["warnings"])
    for step in data["waterfall"]:
        error = "unknown" if step["error"] is None else f"{step['error']:.4g}"
        say(f"error     {step['step']} ({step['kind']}): {error}")
    line = data["baseline"]
    say(
        f"error     plain regression: {line['total']:.4g}; initial velocity held: {line['persistence']['total']:.4g}"
    )
    say(f"result    {found.verdict}", style="bold")
    return found


VERB = Verb(
    summary="the whole loop until nothing improves the model: check, compare, diagnose, add, learn, and the error budget",
    reads=("log", "mapping", "model", "test"),
    writes=("improve.json", "model/", "history/", "report.html", "figures/"),
    run=_run,
    dry_run=check_inputs,
)
