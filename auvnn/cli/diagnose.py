"""`auvnn diagnose`: which physical effect is missing."""

from __future__ import annotations

from auvnn.cli.job import Answering, Job, Verb


def _run(job: Job) -> Answering:
    from auvnn.diagnosis import diagnose

    log = job.log()
    effects = None if job["effects"] is None else job.names("effects")
    model = job.model(log)
    diagnosis = diagnose(
        model, log, effects,
        max_effects=job["max_effects"], window=job["window"], force=job["force"], progress=job.say.progress,
    )  # fmt: skip
    diagnosis.write(job.folder)
    data = diagnosis.to_dict()
    job.warn(data["warnings"])
    for line in data["story"]:
        job.say(f"result    {line}")
    return diagnosis


VERB = Verb(
    summary="which physical effect is missing, with its value and uncertainty",
    reads=("log", "mapping", "model"),
    writes=("diagnosis.json", "report.html", "figures/"),
    run=_run,
)
